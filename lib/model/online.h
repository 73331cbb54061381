/* SPDX-License-Identifier: Apache-2.0 */
/* Private to online.c and its neighbours: kinds of channel, and the effects that run with the values of the model file. */
#ifndef DRIVEID_MODEL_ONLINE_H
#define DRIVEID_MODEL_ONLINE_H

#include <driveid/model.h>

/* ONLINE_LOSS: a = 1 sums the electrical losses, 0 the mechanical ones. ONLINE_DELAYED: signal a, delay_s ago. */
enum { ONLINE_SIGNAL = 0, ONLINE_PRODUCT, ONLINE_SPEED_TIMES, ONLINE_ONE, ONLINE_SIGN, ONLINE_LOSS, ONLINE_DELAYED };

/* How an effect of the model takes part on line. */
typedef enum online_part { ONLINE_PART_NONE, ONLINE_PART_LOSS, ONLINE_PART_DELAY, ONLINE_PART_INERTIA } online_part;

/* Enters effect k of the model. ONLINE_PART_NONE: it does not run, why (why_size) says why. value: dead time, or change of inertia. */
online_part online_enter_effect(driveid_online *online, uint32_t k, double *value, char *why, size_t why_size);

/* Sum of the losses of one kind at a sample; online->speed is that of the sample. */
double online_losses(driveid_online *online, const driveid_sample *sample, int electrical);

/* The driving signal, delay_s before the instant t_ns. */
void online_remember(driveid_online *online, const driveid_sample *sample);
double online_delayed(const driveid_online *online, int64_t t_ns);

#endif
