/* SPDX-License-Identifier: Apache-2.0 */
/* Number type of the templates (*.inc): T(name) gives name_f64. No include guard: each template set is read once a type. */
#undef REAL
#undef T
#undef REAL_TINY
#define REAL double
#define T(name) name##_f64
#define REAL_TINY 1e-17 /* relative size of a negligible term */
