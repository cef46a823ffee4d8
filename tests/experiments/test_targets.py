"""What training is to learn from: no noise, and no fault of the denoiser that took it away."""

import numpy as np

from experiments.rendering.commands.targets import with_detail


def test_what_both_halves_show_comes_back_and_their_noise_does_not(rng):
    y, x = np.mgrid[:64, :96]
    truth = np.ones((64, 96, 3)) * (1 + 0.5 * ((x + y) % 2) * (x < 48))[..., None]
    first, second = (truth * rng.gamma(50, 1 / 50, truth.shape) for _ in range(2))
    denoised = np.where(truth != 1, truth.mean(), np.where(x[..., None] < 48, truth.mean(), 1))
    result = with_detail(denoised, first, second)
    noisy = (first + second) / 2
    textured, plain = np.s_[:, :40], np.s_[:, 56:]
    error = lambda image, part: np.mean((image[part] - truth[part]) ** 2)
    assert error(result, textured) < 0.3 * error(denoised, textured)
    assert error(result, plain) < 0.1 * error(noisy, plain)
