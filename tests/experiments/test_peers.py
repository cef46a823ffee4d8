"""The other peers: naive versions, exact cases, invariants."""

import dataclasses

import numpy as np
import pytest
from scipy.ndimage import correlate

from experiments.peers import atrous, bmfr, guided, nfor, svgf

PEERS = {
    "guided": (guided, guided.PAPER),
    "fast guided": (guided, guided.FAST_TUNED),
    "a-trous": (atrous, atrous.PAPER),
    "svgf": (svgf, svgf.PAPER),
    "bmfr": (bmfr, bmfr.PAPER),
    "bmfr, 2 grids": (bmfr, bmfr.PAPER | {"grids": 2}),
}


@pytest.mark.parametrize("name", PEERS)
def test_constant_light_stays_constant(frame, name):
    peer, parameters = PEERS[name]
    flat = dataclasses.replace(frame, indirect=np.full_like(frame.indirect, 0.7))
    result = np.asarray(peer.denoise(flat, **parameters))
    assert result.dtype == np.float32
    # The noise that regularises BMFR leaves a trace of itself.
    tolerance = 1e-2 if peer is bmfr else 1e-3
    np.testing.assert_allclose(result, flat.indirect, rtol=tolerance)


@pytest.mark.parametrize("name", PEERS)
def test_noise_becomes_less(frame, name):
    peer, parameters = PEERS[name]
    error = lambda image: np.mean((np.asarray(image) - frame.reference) ** 2)
    assert error(peer.denoise(frame, **parameters)) < error(frame.indirect)


def test_atrous_without_edges_is_a_spline_with_holes(frame):
    ours = atrous.denoise(frame, levels=2, colour=1e9, normal=1e9, position=1e9)
    line = np.array([1, 4, 6, 4, 1]) / 16
    image, ones = np.asarray(frame.indirect, np.float64), np.ones(frame.indirect.shape[:2])
    for holes in (1, 2):
        taps = np.zeros(4 * holes + 1)
        taps[::holes] = line
        kernel = np.outer(taps, taps)
        weight = correlate(ones, kernel, mode="constant")[..., None]
        image = correlate(image, kernel[..., None], mode="constant") / weight
    np.testing.assert_allclose(ours, image, rtol=1e-4)


def test_svgf_does_not_mix_across_normals(frame):
    normal = np.zeros_like(frame.normal)
    normal[:, :20, 0], normal[:, 20:, 1] = 1, 1
    light = np.where(np.arange(40)[None, :, None] < 20, 1.0, 3.0) * np.ones_like(frame.indirect)
    noise = np.random.default_rng(2).uniform(0.9, 1.1, light.shape)
    two = dataclasses.replace(frame, normal=normal, indirect=np.float32(light * noise))
    result = np.asarray(svgf.denoise(two, **svgf.PAPER))
    np.testing.assert_allclose(result, light, rtol=0.1)
    assert np.std(result[:, :20]) < 0.5 * np.std(two.indirect[:, :20])


def test_bmfr_is_least_squares_in_every_block(frame):
    ours = bmfr.denoise(frame, features=("depth",), block=8, noise=1e-3, grids=1)
    for corner in ((0, 0), (8, 32)):
        place = tuple(slice(start, start + 8) for start in corner)
        layers = [np.ones((8, 8, 1)), frame.depth[place]]
        x = np.concatenate(layers, -1).reshape(64, -1)
        y = frame.indirect[place].reshape(64, 3)
        truth = np.maximum(x @ np.linalg.lstsq(x, y)[0], 0)
        np.testing.assert_allclose(ours[place].reshape(64, 3), truth, atol=0.03)


def test_nfor_recovers_light_linear_in_the_guides(frame):
    light = np.float32(0.5 + frame.ao * np.array([1, 2, 3]) + frame.depth)
    noise = np.random.default_rng(0).normal(0, 0.02, (2, *light.shape)).astype(np.float32)
    halves = ((light + noise[0], 1), (light + noise[1], 4))
    options = {"guides": ("depth", "ao"), "radius": 4, "patch": 1, "bandwidths": (1.0, 2.0)}
    result = np.asarray(nfor.denoise(frame, halves=halves, **options))
    assert np.sqrt(np.mean((result - light) ** 2)) < 0.006


def test_nfor_needs_no_single_noisy_layer(frame):
    halves = ((frame.indirect, 1), (frame.reference, 4))
    options = {"guides": ("depth",), "radius": 2, "patch": 1, "bandwidths": (0.5, 1.0)}
    a = nfor.denoise(frame, halves=halves, **options)
    blind = dataclasses.replace(frame, indirect=np.zeros_like(frame.indirect))
    np.testing.assert_array_equal(a, nfor.denoise(blind, halves=halves, **options))
