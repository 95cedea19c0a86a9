"""English words: forms of verbs, synonyms, random phrasings and typing errors."""
