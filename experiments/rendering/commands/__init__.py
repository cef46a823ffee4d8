"""One file per command of the renderer, each with `run(arguments)`."""
