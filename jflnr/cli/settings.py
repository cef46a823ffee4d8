"""From the options of `jflnr denoise` to the keyword arguments of `jflnr.denoise`."""

import argparse
from typing import Any


def settings_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """Keyword arguments of `jflnr.denoise`: the options, over the file's, over the defaults."""
    from jflnr import checks
    from jflnr.denoising import BACKENDS, BLOCK, METHODS
    from jflnr.regression import parameters

    checks.choice("--method", arguments.method, METHODS)
    checks.choice("--backend", arguments.backend, BACKENDS)
    if arguments.profile and arguments.backend != "opencl":
        raise ValueError("--profile times OpenCL kernels, so it needs --backend opencl")
    if arguments.explain and arguments.method != "auto":
        raise ValueError("--explain tells what --method auto chose, so it needs that method")
    if arguments.method != "flr":
        return _settings_of_another(arguments)
    model, about = parameters.DEFAULT, dict[str, Any]()
    if arguments.params:
        model, about = _load(arguments)
    values = {}
    for name in ("sigma", "eps", "eps_prime"):
        given = getattr(arguments, name)
        values[name] = float(getattr(model, name)) if given is None else given
    return {
        "method": arguments.method,
        "backend": arguments.backend,
        "parameters": parameters.Parameters.of(**values),
        "guides": _guides(about) if arguments.guides is None else arguments.guides,
        "block": about.get("block", BLOCK) if arguments.block is None else arguments.block,
    }


def _settings_of_another(arguments: argparse.Namespace) -> dict[str, Any]:
    """As `settings_of`, for methods that have no sigma, eps and eps' to set."""
    from jflnr.denoising import BLOCK
    from jflnr.network import METHODS, weights

    learned = arguments.method in ("flr-adaptive", *METHODS)
    for name in ("sigma", "eps", "eps_prime", *(() if learned else ("params",))):
        if getattr(arguments, name) is not None:
            option = name.replace("_", "-")
            raise ValueError(f"--{option} is for --method flr; {arguments.method} finds its own")
    if arguments.method == "bmfr" and arguments.guides is not None:
        raise ValueError("--guides is not for --method bmfr, whose features are the paper's")
    own, about = None, dict[str, Any]()
    if arguments.params is not None and arguments.method in METHODS:
        own = weights.load(arguments.params)[0]
    elif arguments.params is not None:
        own, about = _load(arguments)
    return {
        "method": arguments.method,
        "backend": arguments.backend,
        "parameters": own,
        "guides": _guides(about) if arguments.guides is None else arguments.guides,
        "block": BLOCK if arguments.block is None else arguments.block,
    }


def _load(arguments: argparse.Namespace) -> tuple[Any, dict[str, Any]]:
    """The parameters that `--params` names, which must be the method's."""
    from jflnr.regression.parameters import load_parameters, method_of

    model, about = load_parameters(arguments.params)
    if (fitted := method_of(model)) != arguments.method:
        raise ValueError(
            f"{arguments.params} holds parameters of method {fitted}, and --method is "
            f"{arguments.method}; `jflnr fit --method {arguments.method}` makes what is needed"
        )
    return model, about


def _guides(about: dict[str, Any]) -> list[str] | None:
    """The guides that a parameter file names, if it does."""
    guides = about.get("guides")
    if guides is None or (isinstance(guides, list) and all(isinstance(g, str) for g in guides)):
        return guides
    raise ValueError(f"--params: its guides must be a list of names; got {guides!r}")
