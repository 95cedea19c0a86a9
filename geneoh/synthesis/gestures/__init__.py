"""Made bodies that gesture with their hands, with sentences, from which BOTH2Hands is learned."""
