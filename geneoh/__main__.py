"""`python -m geneoh`: the command `geneoh` of this environment."""

from importlib.metadata import entry_points

if __name__ == "__main__":
    (command,) = entry_points(group="console_scripts", name="geneoh")
    command.load()(prog_name="geneoh")
