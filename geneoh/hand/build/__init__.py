"""The maker of the embedded hand: `python -m geneoh.hand.build OUT.npz` writes the asset anew."""
