/* SPDX-License-Identifier: Apache-2.0 */
/* can_blast INTERFACE RATE_Hz SECONDS [CAN_ID]: send classic frames at a steady rate; prints how many the kernel took and how fast.
 * Data: u32 counter, u32 ~counter. A full queue is waited for, never counted as sent. */
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "clock.h"

int main(int argc, char **argv)
{
    if (argc < 4) {
        fprintf(stderr, "usage: can_blast INTERFACE RATE_Hz SECONDS [CAN_ID]\n");
        return 2;
    }
    double rate_Hz = atof(argv[2]), seconds = atof(argv[3]);
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(argv[1])};
    int bus = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (bus < 0 || address.can_ifindex == 0 || bind(bus, (struct sockaddr *)&address, sizeof address) < 0) {
        perror(argv[1]);
        return 1;
    }
    setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0); /* it only sends */
    struct can_frame frame = {.can_id = argc > 4 ? (canid_t)strtoul(argv[4], NULL, 0) : 0x181, .can_dlc = 8};
    const uint32_t total = (uint32_t)(rate_Hz * seconds);
    const int64_t start = now_ns();
    for (uint32_t sent = 0; sent < total;) {
        /* A batch a millisecond: what a busy bus looks like to a receiver. */
        uint32_t due = (uint32_t)((double)(now_ns() - start) * 1e-9 * rate_Hz) + 1;
        for (; sent < due && sent < total; sent++) {
            uint32_t word[2] = {sent, ~sent};
            memcpy(frame.data, word, sizeof word);
            while (write(bus, &frame, sizeof frame) != (ssize_t)sizeof frame) {
                if (errno != ENOBUFS && errno != EAGAIN && errno != EINTR) {
                    perror("write");
                    return 1;
                }
                sleep_until(now_ns() + 200000);
            }
        }
        sleep_until(start + (int64_t)(sent / rate_Hz * 1e9) + 1000000);
    }
    printf("%u %.0f\n", total, total / ((double)(now_ns() - start) * 1e-9));
    return 0;
}
