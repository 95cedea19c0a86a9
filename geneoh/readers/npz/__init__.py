"""The npz files of geneoh and those of others."""
