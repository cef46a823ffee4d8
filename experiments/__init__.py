"""How jflnr argues: one file per question. `python -m experiments list` names them."""
