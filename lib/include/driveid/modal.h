/* SPDX-License-Identifier: Apache-2.0 */
/* Modal functions: off-line identification of an n-th order linear system from its output and the modes of its input.
 *
 * Purpose    a, b, poles, frequency, step and impulse response and a minimum-time observer, free of initial conditions.
 * Model      D^n y + sum a_j D^j y = sum b_j D^j u [EQ MOD-1.1]; the input is the free response of a known controller with
 *            matrix A_c and output c_c, so that u = c_c' x_c, D x_c = A_c x_c [EQ MOD-2.35, 2.36].
 * Method     El-Shafey, University of British Columbia, 1987. The modal function D^j y(t) + sum_i p_ji y(t - T_i) = q_j' x_c(t)
 *            [EQ MOD-2.44] holds for every initial state. p_j and q_j come from samples or from averages against Fourier or
 *            Walsh functions. Least squares by rank-revealing QR; normal equations are never formed.
 * Memory     allocates while it runs; nothing is kept. Thread-safe.
 * Returns    DRIVEID_OK; DRIVEID_ERR_ARGUMENT (sizes, indices outside the record); DRIVEID_RANK (the data do not separate the
 *            unknowns; nothing is written).
 * Accuracy   tests/paper/elshafey_*.cpp: every table of the thesis at the reachable value, with the printed one beside it. */
#ifndef DRIVEID_MODAL_H
#define DRIVEID_MODAL_H

#include <stddef.h>
#include <stdint.h>

#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum driveid_basis {
    DRIVEID_BASIS_SAMPLES = 0, /* one equation a sample instant [EQ MOD-3.10]; derivatives j > 0 are not to be had */
    DRIVEID_BASIS_FOURIER = 1, /* sin, cos of k * 2 pi / T_o, k = 1 .. functions/2 [EQ MOD-3.17] */
    DRIVEID_BASIS_WALSH = 2    /* functions = a power of two, fast transform [EQ MOD-3.18] */
} driveid_basis;

typedef enum driveid_quadrature {
    DRIVEID_QUADRATURE_TRAPEZOID = 0,
    DRIVEID_QUADRATURE_SIMPSON = 1, /* needs an even number of intervals a block */
    DRIVEID_QUADRATURE_BOOLE = 2    /* needs a multiple of four intervals a block */
} driveid_quadrature;

typedef struct driveid_modal_task {
    size_t order;          /* n, 1 .. 12 */
    double T_s;            /* sampling interval, s */
    size_t rows;           /* samples in y */
    const double *y;       /* [rows] */
    size_t modes;          /* input modes n_c; 0: the free response */
    const double *mode;    /* [rows x modes] row-major: x_c(t_k); may be NULL where modes is 0 */
    const int32_t *shift;  /* [order] modal time shifts T_i in samples, distinct; negative shifts look ahead */
    size_t windows;        /* ranges of instants where the modal function holds; they are concatenated */
    const size_t *first;   /* [windows] first sample of each */
    const size_t *last;    /* [windows] last sample of each, inclusive; Fourier and Walsh integrate first .. last */
    driveid_basis basis;
    size_t functions;      /* Fourier: even, Walsh: power of two dividing the intervals */
    driveid_quadrature quadrature;
    size_t stride;         /* SAMPLES: instants are first, first + stride, ... */
    int32_t instrument;    /* SAMPLES: shift of the instrumental variable in samples, 0: least squares [EQ MOD-3.19] */
} driveid_modal_task;

/* Modal parameters of the output and its first `derivatives` derivatives: p[(derivatives+1) x order], q[(derivatives+1) x modes]. */
driveid_status driveid_modal_parameters(const driveid_modal_task *task, size_t derivatives, double *p, double *q);

/* True modal parameters of a known characteristic polynomial a[order] (a_0 first): p_j' = -c' A^j psi^-1 [EQ MOD-2.30]. */
driveid_status driveid_modal_parameters_from_a(size_t order, const double *a, double T_s, const int32_t *shift,
                                               size_t derivatives, double *p);

/* Filter l[modes] that annihilates the modes (A_c[modes x modes], c_c[modes]) at the given shifts [EQ MOD-3.43]. */
driveid_status driveid_modal_prefilter(size_t modes, const double *A_c, const double *c_c, double T_s, const int32_t *shift, double *l);

/* a[order] from p[(order+1) x order] (Theorem 4.1) [EQ MOD-4.17]. */
driveid_status driveid_modal_a(size_t order, const double *p, double *a);

/* One experiment for b or for (a, b): the modes of one (pre-filtered) input and the q estimated with them. */
typedef struct driveid_modal_experiment {
    size_t modes;
    const double *A_c;  /* [modes x modes] row-major */
    const double *c_c;  /* [modes]: u = c_c' x_c */
    const double *q;    /* [(order+1) x modes] for driveid_modal_b, [modes] (q_o alone) for driveid_modal_ab */
} driveid_modal_experiment;

/* b[zeros+1] from a and the q of all derivatives (Theorem 4.2) [EQ MOD-4.31]. Needs at least zeros+1 modes in all. */
driveid_status driveid_modal_b(size_t order, size_t zeros, const double *a, size_t experiments, const driveid_modal_experiment *experiment, double *b);

/* a[order], b[order] from output modal functions alone [EQ MOD-4.14]. p_o[experiments x order]. Needs 2 order modes in all. */
driveid_status driveid_modal_ab(size_t order, double T_s, const int32_t *shift, const double *p_o, size_t experiments,
                                const driveid_modal_experiment *experiment, double *a, double *b);

/* Free response (Theorem 4.3): `blocks` integrals of `block` intervals each, the k-th from sample start + k*hop; time shifts as
 * above. Characteristic polynomial a[order] and poles re[order], im[order]. untustin: take the trapezoid's frequency warp back. */
driveid_status driveid_modal_free_response(size_t order, double T_s, size_t rows, const double *y, const int32_t *shift,
                                           size_t start, size_t block, size_t hop, size_t blocks, driveid_quadrature quadrature,
                                           int untustin, double *a, double *re, double *im);

/* Divide a known controller out of an augmented characteristic polynomial [EQ MOD-4.63], least squares. a_aug[n+n_c] -> a[n]. */
driveid_status driveid_modal_deflate(size_t order, size_t controller, const double *a_aug, const double *a_c, double *a);

/* Frequency response H(j omega_k) from filtered samples over one period [EQ MOD-5.14]; window first .. last inclusive. */
driveid_status driveid_modal_frequency_response(const driveid_modal_task *task, const double *u, const double *p_o, size_t count,
                                                const double *omega_rad_s, double *re, double *im);

/* Step response g[count] every sample from an output driven by inputs that are constant over `hold` samples (u_level[levels]); p_o
 * belongs to the shifts hold, 2 hold, ... [EQ MOD-5.32, 5.37]. */
driveid_status driveid_modal_step_response(size_t order, size_t rows, const double *y, size_t hold, size_t levels,
                                           const double *u_level, const double *p_o, size_t count, double *g);

/* Impulse response h[count] from a step response g[rows], through first-derivative modal parameters with negative shifts
 * hold, 2 hold, ..., estimated over `period` samples with `functions` Fourier functions [EQ MOD-5.40 .. 5.42]. count + order*hold <= rows. */
driveid_status driveid_modal_impulse_response(size_t order, double T_s, size_t rows, const double *g, size_t hold, size_t period,
                                              size_t functions, size_t count, double *h);

/* Minimum-time observer x(kT+s) = -P y + Q ubar [EQ MOD-6.30]: p[order x order] are p_0 .. p_{order-1} at shifts hold, 2 hold, ...;
 * g is the step response every sample (at least (order+1)*hold + 1 values); s: phase in samples, 0 .. hold-1.
 * Q[order x (order+1)]; column 0 belongs to u(k). */
driveid_status driveid_modal_observer(size_t order, const double *p, size_t hold, const double *g, size_t phase, double *Q);

/* Input vector b~[order] of the state model whose states are the output and its derivatives less what the input adds, from a step response and its modal
 * parameters p[(order+1) x order] at shifts hold, 2 hold, ... [EQ MOD-6.37, 6.43]; its elements are b(s)/a(s) divided out in powers of 1/s. g as above, at least
 * (order+1)*hold + 1 values. A plant that integrates has no constant modal function of a step: DRIVEID_RANK. */
driveid_status driveid_modal_state_input(size_t order, const double *p, size_t hold, size_t rows, const double *g, double *b);

/* Complex exponents s_k of y = sum C_k e^(s_k t) by linear prediction with lag samples between rows (Prony), in QR arithmetic.
 * equations rows, condition (may be NULL) of the prediction matrix. */
driveid_status driveid_prony(size_t order, double T_s, size_t rows, const double *y, size_t lag, size_t equations,
                             double *re, double *im, double *condition);

#ifdef __cplusplus
}
#endif
#endif
