/* A gripper on a serial line that costs next to nothing, and a bare client: what a hand is measured beside.
 *
 *     line gripper MODEL LINK SILENCE_MS TURNAROUND_MS
 *
 * makes a pseudo terminal, points LINK at it and serves until its standard input ends. A reply is there when
 * its last byte would be at 115200 baud: the bytes of the request, SILENCE, TURNAROUND, the bytes of the reply.
 * Functions 3, 4, 16 and 23 on whole frames of unit 9. The gripper, 2f85 or 3f, is active at once and where it is
 * told to be.
 *
 *     line bare PORT HZ SECONDS
 *
 * writes and reads in every cycle with function 23, HZ times a second, 0 for as often as the line bears. Prints
 * what it reached, as JSON. A command comes at a random moment, waits for the next cycle and is shown by its
 * reply.
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { UNIT = 9, REGISTERS = 8, REQUEST = 1000, STATUS = 2000, MOST = 256 };
static const double BYTE_S = 10.0 / 115200;

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + t.tv_nsec * 1e-9;
}

static void sleep_until(double when) {
    struct timespec t = {(time_t)when, (long)((when - (time_t)when) * 1e9)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL)) {
    }
}

static int with_checksum(uint8_t *frame, int size) {
    uint16_t sum = 0xFFFF;
    for (int i = 0; i < size; i++) {
        sum ^= frame[i];
        for (int bit = 0; bit < 8; bit++) sum = sum & 1 ? sum >> 1 ^ 0xA001 : sum >> 1;
    }
    frame[size] = sum & 0xFF;
    frame[size + 1] = sum >> 8;
    return size + 2;
}

static int word(const uint8_t *at) { return at[0] << 8 | at[1]; }

static void raw(int fd) {
    struct termios t;
    tcgetattr(fd, &t);
    cfmakeraw(&t);
    tcsetattr(fd, TCSANOW, &t);
}

/* -- the gripper ----------------------------------------------------------------------------------------- */

static uint8_t image[2 * REGISTERS], status[2 * REGISTERS];
static int axes;

static void obey(int first, const uint8_t *content, int bytes) {
    if (first < 0 || 2 * first + bytes > (int)sizeof image) return;
    memcpy(image + 2 * first, content, bytes);
    int active = image[0] & 1, goes = image[0] >> 3 & 1;
    status[0] = active ? (uint8_t)(0xC0 | 0x30 | (image[0] & 0x0F)) : 0;
    if (axes > 1) status[1] = active ? 0xFF : 0; /* on a jaw the object status is in the first byte */
    for (int at = 3; at < 3 + 3 * axes; at += 3) {
        status[at] = image[at];
        if (goes) status[at + 1] = image[at];
    }
}

static int size_of(const uint8_t *frame, int have) {
    int at = frame[1] == 16 ? 6 : frame[1] == 23 ? 10 : 0;
    if (!at) return 8;
    return have > at ? at + 1 + frame[at] + 2 : at + 3;
}

static int reply_to(const uint8_t *frame, uint8_t *reply) {
    if (frame[0] != UNIT) return 0;
    if (frame[1] == 16) {
        obey(word(frame + 2) - REQUEST, frame + 7, frame[6]);
        memcpy(reply, frame, 6);
        return with_checksum(reply, 6);
    }
    if (frame[1] == 23) obey(word(frame + 6) - REQUEST, frame + 11, frame[10]);
    int first = word(frame + 2) - STATUS, count = word(frame + 4);
    if (first < 0 || count < 1 || first + count > REGISTERS) return 0;
    reply[0] = UNIT;
    reply[1] = frame[1];
    reply[2] = 2 * count;
    memcpy(reply + 3, status + 2 * first, 2 * count);
    return with_checksum(reply, 3 + 2 * count);
}

static int serve(const char *link, double silence, double turnaround) {
    int line, slave, have = 0;
    char name[256];
    uint8_t frame[MOST], reply[MOST];
    if (openpty(&line, &slave, name, NULL, NULL)) return 1;
    raw(slave);
    unlink(link);
    if (symlink(name, link)) return 1;
    printf("ready\n");
    fflush(stdout);
    struct pollfd waits[2] = {{line, POLLIN, 0}, {0, POLLIN, 0}};
    while (poll(waits, 2, -1) >= 0 && !waits[1].revents) {
        int came = read(line, frame + have, MOST - have);
        double began = now();
        if (came <= 0) continue;
        have += came;
        if (have < 8 || have < size_of(frame, have)) continue;
        int size = reply_to(frame, reply);
        if (size) {
            sleep_until(began + (have + size) * BYTE_S + silence + turnaround);
            if (write(line, reply, size) != size) return 1;
        }
        have = 0;
    }
    unlink(link);
    return 0;
}

/* -- the bare client ------------------------------------------------------------------------------------- */

static int by_size(const void *a, const void *b) {
    double d = *(const double *)a - *(const double *)b;
    return (d > 0) - (d < 0);
}

static double uniform(void) { return rand() / (RAND_MAX + 1.0); }

static int bare(const char *port, double hz, double seconds) {
    static double took[1000000];
    int line = open(port, O_RDWR | O_NOCTTY), shown = 0, commands = 0;
    if (line < 0) return 1;
    raw(line);
    uint8_t frame[MOST], reply[MOST], target = 0;
    double begins = now(), tick = begins, asked = begins + uniform() / (hz ? hz : 200);
    while (now() < begins + seconds) {
        int is_new = now() >= asked;
        if (is_new) target = (target + 1) % 200;
        uint8_t request[] = {UNIT, 23, STATUS >> 8, STATUS & 255, 0, 3, REQUEST >> 8, REQUEST & 255, 0, 3, 6,
                             9, 0, 0, target, 255, 64};
        memcpy(frame, request, sizeof request);
        int size = with_checksum(frame, sizeof request), have = 0;
        if (write(line, frame, size) != size) return 1;
        struct pollfd waits = {line, POLLIN, 0};
        while (have < 11) {
            if (poll(&waits, 1, 400) != 1) return 1;
            have += read(line, reply + have, MOST - have);
        }
        shown++;
        double came = now();
        if (is_new && reply[6] == target) {
            took[commands++] = came - asked;
            asked = came + uniform() / (hz ? hz : 200);
        }
        if (hz) {
            tick += 1 / hz;
            sleep_until(tick);
        } else {
            sleep_until(came + 3.5 * BYTE_S);
        }
    }
    qsort(took, commands, sizeof *took, by_size);
    printf("{\"statuses\": %f, \"writes\": %f, \"p50\": %f, \"p99\": %f}\n", shown / seconds, shown / seconds,
           took[commands / 2], took[(int)(0.99 * commands)]);
    return 0;
}

int main(int count, char **words) {
    if (count == 6 && !strcmp(words[1], "gripper")) {
        axes = strcmp(words[2], "3f") ? 1 : 4;
        return serve(words[3], atof(words[4]) / 1000, atof(words[5]) / 1000);
    }
    if (count == 5 && !strcmp(words[1], "bare")) return bare(words[2], atof(words[3]), atof(words[4]));
    fprintf(stderr, "line gripper MODEL LINK SILENCE_MS TURNAROUND_MS | line bare PORT HZ SECONDS\n");
    return 2;
}
