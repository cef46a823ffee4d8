"""Random numbers of the renderer: independent ones, and Owen-scrambled (0,2)-sequences.

A generator is a function object with `next_2d() -> mi.Point2f`; every stream is named by a 32-bit
seed, so that no two layers of a frame share one.
"""

from __future__ import annotations

import hashlib
from typing import Any

import drjit as dr
import mitsuba as mi


def stream_seed(*names: object) -> int:
    """A 32-bit seed from any names: equal names give equal seeds, others unrelated ones."""
    text = "/".join(map(str, names)).encode()
    return int.from_bytes(hashlib.blake2b(text, digest_size=4).digest(), "little")


def hash_32(x: Any) -> Any:
    """Mixes the bits of a 32-bit integer (the finaliser of lowbias32)."""
    x = x ^ (x >> 16)
    x = x * mi.UInt32(0x7FEB352D)
    x = x ^ (x >> 15)
    x = x * mi.UInt32(0x846CA68B)
    return x ^ (x >> 16)


def _unit(x: Any) -> Any:
    return dr.minimum(mi.Float(x >> 8) * mi.Float(2.0**-24), mi.Float(1 - 2.0**-24))


def _owen(x: Any, seed: Any) -> Any:
    """Nested uniform scrambling of reversed bits by the hash of Laine and Karras (2011)."""
    x = x + seed
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        x = x ^ (x * mi.UInt32(factor))
    return x


def _pascal(x: Any) -> Any:
    """Sobol's second generator matrix: Pascal's triangle modulo 2, as a product of 5 factors."""
    for shift, mask in (
        (1, 0xAAAAAAAA),
        (2, 0xCCCCCCCC),
        (4, 0xF0F0F0F0),
        (8, 0xFF00FF00),
        (16, 0xFFFF0000),
    ):
        x = x ^ ((x & mi.UInt32(mask)) >> shift)
    return x


def sobol_2d(index: Any, seed: Any) -> mi.Point2f:
    """Point `index` of the Owen-scrambled, shuffled (0,2)-sequence named by `seed`, in [0, 1)^2.

    Burley, "Practical Hash-based Owen Scrambling" (2020): shuffling the index by another nested
    scramble lets several 2D sequences be padded into one sample of more dimensions.
    """
    index = dr.brev(_owen(dr.brev(index), hash_32(seed)))
    first = _owen(index, hash_32(seed ^ mi.UInt32(0x9E3779B9)))
    second = _owen(_pascal(index), hash_32(seed ^ mi.UInt32(0x85EBCA6B)))
    return mi.Point2f(_unit(dr.brev(first)), _unit(dr.brev(second)))


class Independent:
    """Uniform points from a PCG32 of its own for every lane."""

    def __init__(self, generator: Any) -> None:
        self.generator = generator

    @staticmethod
    def start(lane: Any, seed: Any) -> Any:
        """The PCG32 of every lane, unrelated between lanes and between seeds."""
        state, sequence = mi.sample_tea_32(seed, lane)
        generator: Any = mi.PCG32
        return generator(initstate=mi.UInt64(state), initseq=mi.UInt64(sequence))

    def next_2d(self) -> mi.Point2f:
        return mi.Point2f(self.generator.next_float32(), self.generator.next_float32())


class Stratified:
    """One point after another of padded, scrambled (0,2)-sequences: sample `index` of a pixel."""

    def __init__(self, lane: Any, seed: Any, index: Any) -> None:
        self.seed = hash_32(lane ^ hash_32(seed))
        self.index = index

    def next_2d(self) -> mi.Point2f:
        self.seed = hash_32(self.seed + mi.UInt32(0x9E3779B9))
        return sobol_2d(self.index, self.seed)
