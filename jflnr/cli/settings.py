"""From the options of `jflnr denoise` to the keyword arguments of `jflnr.Denoiser`."""

import argparse
from typing import Any

from jflnr.cli.common import refuse
from jflnr.methods import AUTO, DEFAULT, PICTURES, method_of
from jflnr.parameters import METHODS, load_parameters

# Options that are of the default method, if no other is named.
OF_DEFAULT = ("guides", "params", "sigma", "eps", "eps_prime")


def settings_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """Method, backend and guides: the options, over the file's, over the defaults.

    Without a method it is None, and each frame gets its own, unless other options are of one.
    """
    backend = arguments.backend
    if backend == AUTO and (arguments.history is not None or arguments.profile):
        backend = "opencl" if arguments.history is None else "jax"  # they leave no choice
    name = arguments.method
    if name is None and any(getattr(arguments, option) is not None for option in OF_DEFAULT):
        name = DEFAULT
    told = ("flr-adaptive", "auto", "flnr", "flnr-small", *PICTURES)
    if arguments.error_map and name not in told:
        raise ValueError(f"--error-map needs --method {', '.join(told)}")
    if arguments.profile and backend != "opencl":
        raise ValueError("--profile times OpenCL kernels, so it needs --backend opencl")
    if name != "auto":
        why = "is about where --method auto refines: it needs that method"
        refuse(arguments, ("explain", "worth"), why)
    given = {n: getattr(arguments, n) for n in ("sigma", "eps", "eps_prime", "block", "worth")}
    options = {n: value for n, value in given.items() if value is not None}
    if name is None:
        return {"method": None, "backend": backend, **options}
    if name != "flr" and (odd := options.keys() - {"block", "worth"}):
        option = min(odd).replace("_", "-")
        raise ValueError(f"--{option} is for --method flr; {name} finds its own")
    method, about = method_of(name), dict[str, Any]()
    if arguments.params:
        method, about = _load(arguments, method)
        options = {n: about[n] for n in ("block",) if n in about} | options
    if arguments.error_map:
        options["with_error"] = True
    return {
        "method": method_of(method, **options),
        "backend": backend,
        "guides": about.get("guides") if arguments.guides is None else arguments.guides,
    }


def _load(arguments: argparse.Namespace, method: Any) -> tuple[Any, dict[str, Any]]:
    """The method with what `--params` names, and the rest of the file."""
    if hasattr(method, "params"):
        from jflnr.network import weights

        return method_of(method, params=weights.load(arguments.params, method.read)[0]), {}
    if method.name not in METHODS:
        raise ValueError(f"--params is not for --method {method.name}, which finds its own")
    fitted, about = load_parameters(arguments.params)
    if fitted.name != method.name:
        raise ValueError(
            f"{arguments.params} holds parameters of method {fitted.name}, and --method is "
            f"{method.name}; `jflnr fit --method {method.name}` makes what is needed"
        )
    return fitted, about
