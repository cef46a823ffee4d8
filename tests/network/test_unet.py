"""The network's parts against independent ones, on any size."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import correlate

from jflnr.network import flnr, unet
from jflnr.network.features import Read, factors
from tests.oracle import network_numpy


@pytest.mark.parametrize(("size", "stride"), [((5, 7), 1), ((6, 9), 2), ((1, 1), 2)])
def test_convolution_is_scipys(rng, size, stride):
    x, kernel = rng.standard_normal((*size, 3)), rng.standard_normal((3, 3, 3, 2))
    bias = rng.standard_normal(2)
    ours = unet.convolve(jnp.asarray(x), jnp.asarray(kernel), jnp.asarray(bias), stride)
    padded = np.pad(x, [(1, 1), (1, 1), (0, 0)])
    maps = [correlate(padded, kernel[..., o], "valid")[::stride, ::stride, 0] for o in range(2)]
    np.testing.assert_allclose(ours, np.stack(maps, -1) + bias, atol=1e-5)


@pytest.mark.parametrize("size", [(16, 24), (13, 19)])
def test_gains_are_those_of_plain_numpy(rng, params, size):
    light, noisy = rng.exponential(size=(2, *size, 3))
    error, depth, ao = rng.random((3, *size))
    mask = np.float64(rng.random(size) > 0.1)
    light, noisy = light * mask[..., None], noisy * mask[..., None]
    normal = rng.standard_normal((*size, 3))
    images = light, noisy, error, normal, depth, ao, mask
    with jax.enable_x64(True):
        read = Read(*(jnp.asarray(image.reshape(*size, -1)) for image in images))
        gains = jax.jit(lambda params: factors(flnr.said(params, read)))
        ours = gains({n: jnp.float64(v) for n, v in params.items()})
    np.testing.assert_allclose(ours, network_numpy.gains(params, *images), rtol=1e-9)


def test_unpacking_undoes_packing(rng):
    image = jnp.asarray(rng.standard_normal((4, 6, 3)))
    np.testing.assert_array_equal(unet.unpack(unet.pack(image)), image)
