/* SPDX-License-Identifier: Apache-2.0 */
/* Discrete-time algebraic identification in the z and q domain, block by block, without heap.
 *
 * Purpose   difference-equation or Tustin-domain parameters of an n-th order system from blocks of K samples, free of initial
 *           conditions and without noise statistics; every block starts from zero, so nothing drifts.
 * Model     z: sum_i a_i y_(k+i) = sum_i b_i u_(k+i), a_n = 1 [EQ DIS-1], numerator (z+1)^(m-m~) sum b~_i z^i;
 *           q: G = (1 - q/W)^(n-m) sum_i B~_i q^i / (1 + sum_i A_i q^i), W = 2/T_s [EQ DIS-5], q = W (z-1)/(z+1).
 * Method    Fliess, Fuchshumer, Schlacher, Sira-Ramirez 2006: the polynomial chi(k) kills what happened before the block
 *           [EQ DIS-3, 9]; rows alpha+1 .. alpha+rows of the iterated sums (or 1/(z-gamma) filters, z only) [V.1, V.3, V.4], each scaled
 *           to unit maximum, solved by Householder QR with scaled columns. In q the differences act on the polynomial weights,
 *           in closed form, never on the data (summation by parts), so that f32 serves down to 1 ms.
 * Limits    the condition grows tenfold and more an order: at order 6 to 8 a block long against the slow modes gives DRIVEID_RANK, not an answer; z rarely answers there. q needs skipped >= n + 1 (the weights must vanish at the end of the block) and gamma = 1; configure refuses with the reason.
 *           z loses T_s^-4 of its digits (condition 3e10 at 10 ms, 1e16 at 0.5 ms, order 5): f32 is refused there above order 2.
 * Cost      a sample: rows * columns * (n+1)(n+2)/2 multiply-adds (q), rows * columns (z); one solve a block.
 * Accuracy  tests/paper/fliess.cpp (conditions of the paper's tables, poles, noise), fliess_orders.cpp (6 to 8: poles to 1e-2 or DRIVEID_RANK), f32 against f64 there. */
#ifndef DRIVEID_DISCRETE_H
#define DRIVEID_DISCRETE_H

#include <stddef.h>
#include <stdint.h>

#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVEID_DISCRETE_ORDER_MAX 8
#define DRIVEID_DISCRETE_COLUMNS_MAX (2 * DRIVEID_DISCRETE_ORDER_MAX)
#define DRIVEID_DISCRETE_ROWS_MAX 40

typedef enum driveid_discrete_domain { DRIVEID_DISCRETE_Z = 0, DRIVEID_DISCRETE_Q = 1 } driveid_discrete_domain;

typedef struct driveid_discrete_config {
    driveid_discrete_domain domain;
    uint8_t order;    /* n, 1 .. 8 */
    uint8_t zeros;    /* m, 0 .. n-1 */
    uint8_t kept;     /* m~, 0 .. m: zeros that are really estimated; fewer is steadier under noise */
    uint8_t skipped;  /* alpha, 1 .. 20: first rows left out; n+1 .. n+5 is good */
    uint8_t extra;    /* beta, 0 .. 20: rows beyond the unknowns */
    uint32_t block;   /* K, samples: 4 n .. 100000 */
    double T_s;       /* sampling time, s */
    double gamma;     /* 1: sums; 0 < gamma < 1: forgetting sums (z only) */
} driveid_discrete_config;

/* Unknowns in order: z: a_0 .. a_(n-1), b~_0 .. b~_m~; q: A_1 .. A_n (s^i), B~_0 .. B~_m~. */
typedef struct driveid_discrete_estimate {
    uint32_t params;
    uint32_t blocks;                                /* blocks behind mean and interval */
    double theta[DRIVEID_DISCRETE_COLUMNS_MAX];     /* of the last block */
    double mean[DRIVEID_DISCRETE_COLUMNS_MAX];      /* over blocks since the last restart */
    double lo[DRIVEID_DISCRETE_COLUMNS_MAX];        /* 95 % interval of the mean from the scatter of blocks; -inf .. inf before the third */
    double hi[DRIVEID_DISCRETE_COLUMNS_MAX];
    double residual;                                /* rms of the scaled rows after the solve */
} driveid_discrete_estimate;

#define DRIVEID_DISCRETE_TYPE(REAL_, NAME_)                                                                        \
    typedef struct NAME_ {                                                                                         \
        driveid_discrete_config config;                                                                            \
        uint32_t k;                                                                                                \
        uint32_t blocks;                                                                                           \
        double mean[DRIVEID_DISCRETE_COLUMNS_MAX], scatter[DRIVEID_DISCRETE_COLUMNS_MAX];                          \
        double theta[DRIVEID_DISCRETE_COLUMNS_MAX];                                                                \
        double residual;                                                                                           \
        REAL_ row[DRIVEID_DISCRETE_ROWS_MAX][DRIVEID_DISCRETE_COLUMNS_MAX + 1]; /* last column: right-hand side */ \
        REAL_ lost[DRIVEID_DISCRETE_ROWS_MAX][DRIVEID_DISCRETE_COLUMNS_MAX + 1]; /* what rounding took from row */ \
        double square[DRIVEID_DISCRETE_ROWS_MAX][DRIVEID_DISCRETE_COLUMNS_MAX]; /* of what was summed: how far rounding reaches */ \
    } NAME_;
DRIVEID_DISCRETE_TYPE(double, driveid_discrete_f64)
DRIVEID_DISCRETE_TYPE(float, driveid_discrete_f32)

/* DRIVEID_ERR_CONFIG with a sentence in reason where the configuration is refused. A copy of the struct is a snapshot. */
driveid_status driveid_discrete_configure_f64(driveid_discrete_f64 *self, const driveid_discrete_config *config, char *reason, size_t reason_size);
driveid_status driveid_discrete_configure_f32(driveid_discrete_f32 *self, const driveid_discrete_config *config, char *reason, size_t reason_size);

/* One sample. DRIVEID_OK: a block ended and its estimate is new; DRIVEID_NOT_YET: inside a block; DRIVEID_RANK: the block did not
 * excite all unknowns (a column, or what the others leave of it, is no more than the rounding of what was summed), or rounding reaches the answer: it is dropped; DRIVEID_ERR_VALUE: not finite, the block starts anew. A gap is the caller's restart_block. */
driveid_status driveid_discrete_update_f64(driveid_discrete_f64 *self, double y, double u);
driveid_status driveid_discrete_update_f32(driveid_discrete_f32 *self, float y, float u);

/* DRIVEID_NOT_YET before the first block. */
driveid_status driveid_discrete_estimate_f64(const driveid_discrete_f64 *self, driveid_discrete_estimate *out);
driveid_status driveid_discrete_estimate_f32(const driveid_discrete_f32 *self, driveid_discrete_estimate *out);

/* Forget the block that is under way (a gap); the estimates stay. */
void driveid_discrete_restart_block_f64(driveid_discrete_f64 *self);
void driveid_discrete_restart_block_f32(driveid_discrete_f32 *self);

#ifdef __cplusplus
}
#endif
#endif
