// SPDX-License-Identifier: Apache-2.0
// Numbers of channels and layouts, for moments.cl, solve.cl and apply.cl.
//
// Defines, given by the host with -D:
//   Q   number of guides, 0..16, without the constant 1
//   C   number of target channels, 1..9
//   BRIGHTNESS_0 to BRIGHTNESS_2, for adaptive FLR only   weights of the target's channels 0, 1, 2,
//       and again of 3, 4, 5 and so on, in the brightness
//
// Layouts, in C order:
//   target (H, W, C)   guides_i (H, W, PART_i)   weight (H, W)   output (H, W, C)
//   moments (K, h, pitch)   model (Q + 1, C, h, pitch)
// There are h x w blocks; rows of them are `pitch` apart, a multiple of WIDTH, at least w. In the
// columns from w on, moments are 0 and the model means nothing.
//
// Everywhere: OpenCL C 1.2; no local memory, no barriers, no atomics, so that the result depends
// neither on the size of the work-groups nor on their order. Global sizes may be larger than what
// each kernel names: the rest returns at once. Build without -cl-fast-relaxed-math and
// -cl-finite-math-only, which would lose the handling of values that are not finite.

#if !defined(Q) || Q < 0 || Q > 16
#error "Q, the number of guides, must be between 0 and 16"
#endif
#if !defined(C) || C < 1 || C > 9
#error "C, the number of target channels, must be between 1 and 9"
#endif
// Moment planes: the lower triangle of [1, X][1, X]^T row by row, then [1, X] Y^T row by row.
// Written for i >= j.
#define XX(i, j) ((i) * ((i) + 1) / 2 + (j))
#define XY(i, c) ((Q + 1) * (Q + 2) / 2 + (i) * C + (c))
#define K XY(Q + 1, 0)
#define BRIGHTNESS(c) ((c) % 3 == 0 ? BRIGHTNESS_0 : (c) % 3 == 1 ? BRIGHTNESS_1 : BRIGHTNESS_2)
