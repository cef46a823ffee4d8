"""Intel Open Image Denoise on the CPU, through pyoidn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyoidn

from jflnr.frame import Frame

QUALITY = {
    "fast": pyoidn.OIDN_QUALITY_FAST,
    "balanced": pyoidn.OIDN_QUALITY_BALANCED,
    "high": pyoidn.OIDN_QUALITY_HIGH,
}

# As the paper of FLNR ran it: on the picture, with albedo and normal taken as noisy.
PAPER: dict[str, Any] = {"quality": "high", "clean": False, "modulated": True}
TUNED: dict[str, Any] = {"quality": "high", "clean": True, "modulated": False}
FAST_TUNED: dict[str, Any] = {"quality": "fast", "clean": False, "modulated": False}


def filter_for(
    frame: Frame, *, quality: str = "high", clean: bool = False, modulated: bool = False
) -> Callable[[], np.ndarray]:
    """A call that denoises the frame; setting up the network is done here, once.

    quality: a key of `QUALITY`. clean: tell OIDN that albedo and normal have no noise, which makes
    it use a larger network. modulated: feed it `albedo * indirect` and divide afterwards; else it
    sees the demodulated light, with a white albedo. The call returns `(H, W, 3)`, demodulated.
    """
    albedo, normal, noisy = (
        np.ascontiguousarray(a, np.float32) for a in (frame.albedo, frame.normal, frame.indirect)
    )
    colour = np.ascontiguousarray(albedo * noisy) if modulated else noisy
    # Demodulated light is light on white surfaces.
    auxiliary = albedo if modulated else np.ones_like(albedo)
    result = np.zeros_like(colour)
    device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    device.commit()
    network = pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT)
    images = {"color": colour, "albedo": auxiliary, "normal": normal, "output": result}
    for name, image in images.items():
        network.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
    network.set_bool("hdr", True)
    network.set_bool("cleanAux", clean)
    network.set_int("quality", QUALITY[quality])
    network.commit()

    def call() -> np.ndarray:
        network.execute()
        if (error := device.get_error()) is not None:
            raise RuntimeError(f"OIDN: {error}")
        return (
            np.where(albedo > 1e-3, result / np.maximum(albedo, 1e-3), 0) if modulated else result
        )

    # The arrays and the device must outlive the call.
    call.owners = (device, network, images)  # type: ignore[attr-defined]
    return call


def denoise(
    frame: Frame, *, quality: str = "high", clean: bool = False, modulated: bool = False
) -> np.ndarray:
    """OIDN once, `(H, W, 3)` demodulated; see `filter_for`."""
    call = filter_for(frame, quality=quality, clean=clean, modulated=modulated)
    image = call().copy()
    # Python does not free them, and each holds a network.
    device, network, _ = call.owners  # type: ignore[attr-defined]
    network.release()
    device.release()
    return image


def layers(*, cleanAux: bool = False, **images: Any) -> np.ndarray:
    """OIDN on one layer, or on a colour with auxiliaries; the argument is named as its option."""
    device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    device.commit()
    network = pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT)
    given = {name: np.ascontiguousarray(layer, np.float32) for name, layer in images.items()}
    given["output"] = result = np.zeros_like(next(iter(given.values())))
    for name, image in given.items():
        network.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
    network.set_bool("hdr", "color" in images)
    network.set_bool("cleanAux", cleanAux)
    network.commit()
    network.execute()
    error = device.get_error()
    network.release()
    device.release()
    if error is not None:
        raise RuntimeError(f"OIDN: {error}")
    return result


def prefiltered(colour: Any, **auxiliaries: Any) -> np.ndarray:
    """OIDN on a picture `(H, W, 3)` with auxiliary layers that it has filtered before."""
    clean = {name: layers(**{name: layer}) for name, layer in auxiliaries.items()}
    return layers(color=colour, **clean, cleanAux=True)
