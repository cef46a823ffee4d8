"""The network's parts against independent ones, on any size."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import correlate

from jflnr.network import unet


@pytest.mark.parametrize(("size", "stride"), [((5, 7), 1), ((6, 9), 2), ((1, 1), 2)])
def test_convolution_is_scipys(rng, size, stride):
    x, kernel = rng.standard_normal((*size, 3)), rng.standard_normal((3, 3, 3, 2))
    bias = rng.standard_normal(2)
    ours = unet.convolve(jnp.asarray(x), jnp.asarray(kernel), jnp.asarray(bias), stride)
    padded = np.pad(x, [(1, 1), (1, 1), (0, 0)])
    maps = [correlate(padded, kernel[..., o], "valid")[::stride, ::stride, 0] for o in range(2)]
    np.testing.assert_allclose(ours, np.stack(maps, -1) + bias, atol=1e-5)


@pytest.mark.parametrize("size", [(8, 12), (7, 5), (1, 1)])
def test_every_scale_gives_its_outputs_on_any_size(rng, size):
    params = unet.init(jax.random.key(0), 6, (3, 4, 5), (7, 2))
    x = jnp.asarray(rng.standard_normal((*size, 6)), jnp.float32)
    first, second, third = unet.apply(params, x)
    assert first.shape == (*size, 7)
    assert second.shape == (-(-size[0] // 2), -(-size[1] // 2), 2)
    assert third.shape[-1] == 0
    assert not first.any() and not second.any()


def test_the_output_sees_far(rng):
    """A change in one corner reaches blocks that one convolution does not."""
    params = unet.init(jax.random.key(0), 2, (4, 4, 4), (3,))
    params["head0"] = jnp.ones_like(params["head0"])
    x = jnp.asarray(rng.standard_normal((16, 16, 2)), jnp.float32)
    change = unet.apply(params, x.at[0, 0].add(1))[0] - unet.apply(params, x)[0]
    assert jnp.abs(change[8, 8]).max() > 0


@pytest.mark.parametrize("size", [(4, 6), (5, 3)])
def test_unpacking_undoes_packing(rng, size):
    planes = jnp.asarray(rng.standard_normal((3, *size)))
    np.testing.assert_array_equal(unet.unpack(unet.pack(planes), *size), planes)
