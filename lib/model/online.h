/* SPDX-License-Identifier: Apache-2.0 */
/* Private to online.c and online_channels.c: kinds of channel. */
#ifndef DRIVEID_MODEL_ONLINE_H
#define DRIVEID_MODEL_ONLINE_H

enum { ONLINE_SIGNAL = 0, ONLINE_PRODUCT, ONLINE_SPEED_TIMES, ONLINE_ONE, ONLINE_SIGN };

#endif
