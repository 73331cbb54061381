/* SPDX-License-Identifier: Apache-2.0 */
/* modbus_alone serve PORT            a device with 64 input registers
 * modbus_alone poll PORT SECONDS N   read N input registers as fast as they come; prints polls per second */
#include <errno.h>
#include <modbus.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int serve(modbus_t *bus)
{
    modbus_mapping_t *map = modbus_mapping_new(0, 0, 0, 64);
    int listener = modbus_tcp_listen(bus, 1);
    if (!map || listener < 0) {
        fprintf(stderr, "modbus_alone: %s\n", modbus_strerror(errno));
        return 1;
    }
    for (;;) {
        if (modbus_tcp_accept(bus, &listener) < 0)
            return 1;
        uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
        int length;
        while ((length = modbus_receive(bus, query)) >= 0) {
            map->tab_input_registers[0]++;
            modbus_reply(bus, query, length, map);
        }
        modbus_close(bus);
    }
}

static int poll_device(modbus_t *bus, double seconds, int registers)
{
    uint16_t value[125];
    if (modbus_connect(bus) < 0) {
        fprintf(stderr, "modbus_alone: %s\n", modbus_strerror(errno));
        return 1;
    }
    double start = now_s();
    unsigned long polls = 0;
    while (now_s() - start < seconds) {
        if (modbus_read_input_registers(bus, 0, registers, value) != registers)
            return 1;
        polls++;
    }
    printf("%.0f\n", (double)polls / (now_s() - start));
    return 0;
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        fprintf(stderr, "usage: modbus_alone serve PORT | poll PORT SECONDS REGISTERS\n");
        return 2;
    }
    modbus_t *bus = modbus_new_tcp("127.0.0.1", atoi(argv[2]));
    if (!bus)
        return 1;
    modbus_set_slave(bus, 1);
    return strcmp(argv[1], "serve") == 0 ? serve(bus) : poll_device(bus, argc > 3 ? atof(argv[3]) : 2, argc > 4 ? atoi(argv[4]) : 4);
}
