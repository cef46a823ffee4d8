"""What Blender writes of a made-up frame, by the names of its passes."""

import numpy as np

from jflnr.frame import Frame

OLD = {"Diffuse Indirect": "DiffInd", "Diffuse Direct": "DiffDir", "Diffuse Color": "DiffCol"}
OLD |= {"Ambient Occlusion": "AO"}


def passes(frame: Frame, view: str = "ViewLayer", old: bool = False) -> dict[str, np.ndarray]:
    """What Blender would write of `frame`, with a lamp, glossy light and a sky in the picture."""
    depth, glossy = frame.depth.copy(), 0.25 * frame.direct[..., ::-1]
    albedo = frame.albedo.copy()
    albedo[:3], depth[:3], depth[3:5] = 0, 1e10, 3
    albedo[3:5] = 0  # a mirror
    picture = albedo * (frame.direct + frame.indirect) + frame.emission + glossy
    alpha = np.where(depth < 1e9, 1, 0.5)
    layers = {
        "Combined": ("RGBA", np.concatenate([picture, alpha], -1)),
        "Diffuse Indirect": ("RGB", np.where(albedo > 0, frame.indirect, 0)),
        "Diffuse Direct": ("RGB", np.where(albedo > 0, frame.direct, 0)),
        "Diffuse Color": ("RGB", albedo),
        "Glossy Direct": ("RGB", glossy),
        "Normal": ("XYZ", frame.normal),
        "Depth": ("Z", depth),
        "Position": ("XYZ", frame.position),
        "Vector": ("XYZW", np.concatenate([[1, -1] * frame.motion, 5 + 0 * frame.motion], -1)),
        "Ambient Occlusion": ("RGB", np.repeat(frame.ao.round(), 3, -1)),
    }
    return {
        f"{view}.{OLD.get(name, name) if old else name}.{c}": image[..., i].astype(np.float32)
        for name, (components, image) in layers.items()
        for i, c in enumerate(components)
    }
