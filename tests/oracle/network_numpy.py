"""The network of `jflnr/network` in plain numpy and float64: what it reads, and its layers."""

import numpy as np
from scipy.signal import correlate

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def gains(params, light, noisy, error, normal, depth, ao, mask):
    """The factor on every pixel, `(H, W, 3)`. Images `(H, W, 3)` and, the last four but for the
    normal, `(H, W)`; light over the frame's mean."""
    scales = sum(name.startswith("encode") and not name.endswith("bias") for name in params)
    height, width = mask.shape
    side = 2**scales

    def padded(image):
        margins = [(0, -height % side), (0, -width % side)] + [(0, 0)] * (image.ndim - 2)
        return np.pad(np.float64(image), margins)

    light, noisy, error, normal, depth, ao, mask = map(
        padded, (light, noisy, error, normal, depth, ao, mask)
    )
    x, means = pixels(light, noisy, error, normal, depth, ao, mask), of_means(light, noisy, scales)
    said = network(params, x, means, scales)
    return np.exp(1.5 * np.tanh(said / 1.5))[:height, :width]


def pixels(light, noisy, error, normal, depth, ao, mask):
    before, after = light @ LUMINANCE, noisy @ LUMINANCE
    planes = [
        np.log(before + 0.02),
        np.clip((after - before) / (before + 0.05), -1, 4) / 2,
        np.log(1 + (after + 0.05) / (before + 0.05)),
        np.log(error / (before + 0.05) + 0.01) + 1.5,
        *np.log((light + 0.02) / (before + 0.02)[..., None]).transpose(2, 0, 1),
        *normal.transpose(2, 0, 1),
        np.log(depth + 0.05),
        2 * ao - 1,
        np.minimum(error, 3),
        mask,
        np.log(after + 0.03),
    ]
    return np.stack(planes, axis=-1)


def of_means(light, noisy, scales):
    before, after = light @ LUMINANCE, noisy @ LUMINANCE
    robust = np.minimum(after, 4 * before + 0.1)

    def mean(image, side):
        h, w = image.shape[0] // side, image.shape[1] // side
        return image.reshape(h, side, w, side, -1).mean((1, 3))

    def ratio(a, b):
        return np.log((a + 0.05 * b + 0.02) / (1.05 * b + 0.02))

    found = []
    for side in 2 ** np.arange(1, scales + 1):
        dark, light_there = mean(before, side), mean(light, side)
        noise = mean((after - before) ** 2, side) / side**2 / (dark + 0.02) ** 2
        planes = [
            ratio(mean(noisy, side), light_there),
            ratio(mean(after, side), dark),
            ratio(mean(robust, side), dark),
            0.5 * np.log(noise + 1e-3),
        ]
        found.append(np.concatenate(planes, axis=-1))
    return found


def network(params, x, means, scales):
    """`(H, W, 3)` from what is read of the pixels and of the means."""
    params = {name: np.float64(value) for name, value in params.items()}

    def layer(name, x, stride=1):
        kernel, bias = params[name], params[f"{name}_bias"]
        margin = kernel.shape[0] // 2
        x = np.pad(x, [(margin, margin), (margin, margin), (0, 0)])
        maps = [correlate(x, kernel[..., o], "valid")[..., 0] for o in range(len(bias))]
        return np.stack(maps, axis=-1)[::stride, ::stride] + bias

    def leaky(x):
        return np.maximum(x, 0.1 * x)

    corners = [x[dy::2, dx::2] for dy in (0, 1) for dx in (0, 1)]
    x = leaky(layer("stem", np.concatenate([*corners, means[0]], axis=-1)))
    skips = []
    for i in range(scales):
        x = leaky(layer(f"encode{i}", x if i == 0 else np.concatenate([x, means[i]], axis=-1)))
        skips.append(x)
        if i + 1 < scales:
            x = leaky(layer(f"down{i}", x, 2))
    for i in reversed(range(scales - 1)):
        x = leaky(np.kron(layer(f"up{i}", x), np.ones((2, 2, 1))) + skips[i])
        x = leaky(layer(f"decode{i}", x))
    said = layer("head", leaky(layer("last", x)))
    out = np.zeros((2 * said.shape[0], 2 * said.shape[1], 3))
    for k in range(4):
        out[k // 2 :: 2, k % 2 :: 2] = said[..., 3 * k : 3 * k + 3]
    return out
