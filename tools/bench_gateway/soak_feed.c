/* SPDX-License-Identifier: Apache-2.0 */
/* Frames of axes that move and rest, for soak tests.
 *
 *   soak_feed log SECONDS DRIVES RATE_Hz                   candump lines on standard output, as fast as they are taken
 *   soak_feed can SECONDS DRIVES_A_BUS RATE_Hz IFACE...    in real time on CAN interfaces
 *
 * Drive k of a bus has the identifier 0x200 + k. Frame: i16 current (mA), 2 bytes zero, i32 angle (65536 counts a turn). Prints the number of frames on standard error.
 * J dw/dt = K_t i - B w under a current that is held over each sample, solved exactly; J grows with k. */
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <math.h>
#include <net/if.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "clock.h"

#define DRIVES_MAX 64
#define BUSES_MAX 8
#define CYCLE_S 20.0   /* a move and a rest */
#define MOVE_S 5.0

typedef struct axis { double theta, omega, decay, end_a, slow, phase_s; int16_t i_mA; } axis;

static void axis_init(axis *a, int k, double dt_s)
{
    const double J = 2e-4 * (1 + 0.1 * k), B = 1e-3, K_t = 0.05;
    memset(a, 0, sizeof *a);
    a->decay = exp(-B / J * dt_s);
    a->end_a = K_t / B;
    a->slow = (1 - a->decay) * J / B;
    a->phase_s = 0.7 * k;
}

/* Reading at t, then one sample on. The move's current has no mean, the rest is braked. */
static void axis_step(axis *a, double t_s, double dt_s, uint8_t *data)
{
    const double t = fmod(t_s + a->phase_s, CYCLE_S), u = fmod(t, 0.5);
    const double i_A = t > MOVE_S ? (fabs(a->omega) > 1e-3 ? -a->omega / a->end_a / 4 : 0) : u < 0.25 ? (u < 0.137 ? 2.0 : 1.0) : (u < 0.411 ? -1.9 : -1.13);
    const int32_t counts = (int32_t)(int64_t)floor(a->theta * 65536 / (2 * M_PI));
    a->i_mA = (int16_t)lrint(i_A * 1000);
    memset(data, 0, 8);
    memcpy(data, &a->i_mA, 2);
    memcpy(data + 4, &counts, 4);
    const double end = a->end_a * a->i_mA * 1e-3;
    a->theta += end * dt_s + (a->omega - end) * a->slow;
    a->omega = end + (a->omega - end) * a->decay;
}

static char *hex(char *p, const uint8_t *data)
{
    for (int k = 0; k < 8; k++) {
        *p++ = "0123456789ABCDEF"[data[k] >> 4];
        *p++ = "0123456789ABCDEF"[data[k] & 15];
    }
    return p;
}

static uint64_t feed_log(double seconds, int drives, double rate_Hz)
{
    axis a[DRIVES_MAX];
    const double dt_s = 1 / rate_Hz;
    uint64_t sent = 0;
    for (int k = 0; k < drives; k++) axis_init(&a[k], k, dt_s);
    for (uint64_t n = 0; n < (uint64_t)(seconds * rate_Hz); n++) {
        for (int k = 0; k < drives; k++, sent++) {
            uint8_t data[8];
            char line[80];
            axis_step(&a[k], (double)n * dt_s, dt_s, data);
            const int64_t t_us = 1700000000000000 + (int64_t)((double)n * dt_s * 1e6) + 130 * k;
            char *p = line + sprintf(line, "(%lld.%06d) vcan0 %03X#", (long long)(t_us / 1000000), (int)(t_us % 1000000), 0x200 + k);
            p = hex(p, data);
            *p++ = '\n';
            if (fwrite(line, 1, (size_t)(p - line), stdout) == 0) return sent;
        }
    }
    fflush(stdout);
    return sent;
}

static int open_bus(const char *name)
{
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(name)};
    const int bus = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (bus < 0 || address.can_ifindex == 0 || bind(bus, (struct sockaddr *)&address, sizeof address) < 0) {
        perror(name);
        exit(1);
    }
    setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0); /* it only sends */
    return bus;
}

/* One frame of each drive of a bus; a full queue is waited for, never counted as sent. */
static void send_all(int bus, axis *a, int drives, double t_s, double dt_s)
{
    struct can_frame frame[DRIVES_MAX];
    struct iovec vector[DRIVES_MAX];
    struct mmsghdr message[DRIVES_MAX];
    memset(message, 0, sizeof message);
    memset(frame, 0, sizeof frame);
    for (int k = 0; k < drives; k++) {
        frame[k].can_id = (canid_t)(0x200 + k);
        frame[k].can_dlc = 8;
        axis_step(&a[k], t_s, dt_s, frame[k].data);
        vector[k] = (struct iovec){&frame[k], sizeof frame[k]};
        message[k].msg_hdr.msg_iov = &vector[k];
        message[k].msg_hdr.msg_iovlen = 1;
    }
    for (int done = 0; done < drives;) {
        const int n = sendmmsg(bus, message + done, (unsigned)(drives - done), 0);
        if (n > 0) done += n;
        else if (errno == ENOBUFS || errno == EAGAIN || errno == EINTR) sleep_until(now_ns() + 200000);
        else {
            perror("sendmmsg");
            exit(1);
        }
    }
}

static uint64_t feed_can(double seconds, int drives, double rate_Hz, int buses, char **names)
{
    static axis a[BUSES_MAX][DRIVES_MAX];
    int bus[BUSES_MAX];
    const double dt_s = 1 / rate_Hz;
    const uint64_t samples = (uint64_t)(seconds * rate_Hz);
    for (int b = 0; b < buses; b++) {
        bus[b] = open_bus(names[b]);
        for (int k = 0; k < drives; k++) axis_init(&a[b][k], k, dt_s);
    }
    const int64_t start = now_ns();
    for (uint64_t n = 0; n < samples; n++) {
        sleep_until(start + (int64_t)((double)n * dt_s * 1e9));
        for (int b = 0; b < buses; b++) send_all(bus[b], a[b], drives, (double)n * dt_s, dt_s);
    }
    fprintf(stderr, "%.3f s\n", (double)(now_ns() - start) * 1e-9);
    return samples * (uint64_t)(drives * buses);
}

int main(int argc, char **argv)
{
    const int can = argc > 5 && strcmp(argv[1], "can") == 0;
    if (!can && !(argc == 5 && strcmp(argv[1], "log") == 0)) {
        fprintf(stderr, "usage: soak_feed log SECONDS DRIVES RATE_Hz | soak_feed can SECONDS DRIVES_A_BUS RATE_Hz IFACE...\n");
        return 2;
    }
    const double seconds = atof(argv[2]), rate_Hz = atof(argv[4]);
    const int drives = atoi(argv[3]);
    if (drives < 1 || drives > DRIVES_MAX || !(rate_Hz > 0) || argc - 5 > BUSES_MAX) {
        fprintf(stderr, "soak_feed: 1 to %d drives, at most %d buses\n", DRIVES_MAX, BUSES_MAX);
        return 2;
    }
    const uint64_t sent = can ? feed_can(seconds, drives, rate_Hz, argc - 5, argv + 5) : feed_log(seconds, drives, rate_Hz);
    fprintf(stderr, "%llu\n", (unsigned long long)sent);
    return 0;
}
