/* What a C thread does: poll one gripper with libmodbus at absolute deadlines.
 *
 *     thread PORT INTERVAL_US POLLS
 *
 * Prints the CPU seconds it took, and then one line for each poll: when it began and how long its reply
 * took, in nanoseconds.
 */
#include <errno.h>
#include <modbus/modbus.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static int64_t now(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

int main(int argc, char **argv) {
    if (argc != 4) {
        fprintf(stderr, "usage: thread PORT INTERVAL_US POLLS\n");
        return 2;
    }
    int64_t interval = atoll(argv[2]) * 1000;
    int polls = atoi(argv[3]);
    int64_t *began = malloc(2 * (size_t)polls * sizeof *began);
    modbus_t *link = modbus_new_tcp("127.0.0.1", atoi(argv[1]));
    if (began == NULL || link == NULL || modbus_set_slave(link, 2) != 0 || modbus_connect(link) != 0) {
        fprintf(stderr, "thread: cannot connect: %s\n", modbus_strerror(errno));
        return 1;
    }
    int64_t used = now(CLOCK_PROCESS_CPUTIME_ID), deadline = now(CLOCK_MONOTONIC);
    for (int poll = 0; poll < polls; poll++) {
        uint16_t registers[8];
        deadline += interval;
        struct timespec until = {deadline / 1000000000, deadline % 1000000000};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        began[2 * poll] = now(CLOCK_MONOTONIC);
        if (modbus_read_input_registers(link, 0, 8, registers) != 8) {
            fprintf(stderr, "thread: no answer: %s\n", modbus_strerror(errno));
            return 1;
        }
        began[2 * poll + 1] = now(CLOCK_MONOTONIC) - began[2 * poll];
    }
    printf("%.9f\n", (now(CLOCK_PROCESS_CPUTIME_ID) - used) / 1e9);
    for (int poll = 0; poll < polls; poll++)
        printf("%lld %lld\n", (long long)began[2 * poll], (long long)began[2 * poll + 1]);
    return 0;
}
