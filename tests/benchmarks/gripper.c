/* A gripper that costs next to nothing: what the benchmarks poll.
 *
 *     gripper COUNT
 *
 * listens on COUNT ports of the loopback interface, prints them on one line and serves until its standard
 * input ends. Every port is an active gripper of its own that goes wherever it is told at once: FC04 reads
 * the status, FC16 writes the request, whole frames only. Nothing else is checked: it is no simulator.
 */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

enum { BYTES = 16, HEADER = 7, MOST = 1024 };

/* Status as the gripper shows it: active, going, every axis at its position. */
static unsigned char status[MOST][BYTES];
/* What each descriptor belongs to: the gripper's number, and whether it listens. */
static int gripper_of[8192];
static char listens[8192];

static void begin(int gripper) {
    unsigned char *s = status[gripper];
    s[0] = 0xF9; /* gACT, gGTO, gIMC = 3, gSTA = 3 */
    s[1] = 0xFF; /* gDT = 3 for every axis */
}

static void take(int gripper, const unsigned char *request) {
    unsigned char *s = status[gripper];
    s[0] = (unsigned char)(0xF0 | (request[0] & 0x09));
    for (int axis = 0; axis < 4; axis++)
        s[3 + 3 * axis] = s[4 + 3 * axis] = request[3 + 3 * axis];
}

static void serve(int fd) {
    unsigned char in[264], out[HEADER + 2 + BYTES];
    ssize_t size = recv(fd, in, sizeof in, 0);
    if (size <= 0) {
        close(fd);
        return;
    }
    memcpy(out, in, HEADER);
    int length;
    if (size == 12 && in[HEADER] == 4 && in[HEADER + 4] <= BYTES / 2) {
        unsigned char bytes = (unsigned char)(2 * in[HEADER + 4]);
        out[HEADER] = 4;
        out[HEADER + 1] = bytes;
        memcpy(out + HEADER + 2, status[gripper_of[fd]], bytes);
        length = HEADER + 2 + bytes;
    } else if (size == 29 && in[HEADER] == 16) {
        take(gripper_of[fd], in + HEADER + 6);
        memcpy(out + HEADER, in + HEADER, 5);
        length = HEADER + 5;
    } else {
        close(fd);
        return;
    }
    out[5] = (unsigned char)(length - 6);
    if (send(fd, out, (size_t)length, MSG_NOSIGNAL) != length)
        close(fd);
}

static void watch(int epoll, int fd) {
    struct epoll_event event = {.events = EPOLLIN, .data.fd = fd};
    if (fd >= 8192 || epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event) != 0) {
        perror("epoll_ctl");
        exit(1);
    }
}

static int listen_on_loopback(int gripper) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    if (fd < 0 || bind(fd, (struct sockaddr *)&at, size) != 0 || listen(fd, 8) != 0) {
        perror("listen");
        exit(1);
    }
    getsockname(fd, (struct sockaddr *)&at, &size);
    printf("%d ", ntohs(at.sin_port));
    gripper_of[fd] = gripper;
    listens[fd] = 1;
    return fd;
}

static void admit(int epoll, int listener) {
    int fd = accept(listener, NULL, NULL), yes = 1;
    if (fd < 0)
        return;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    watch(epoll, fd);
    gripper_of[fd] = gripper_of[listener];
    listens[fd] = 0;
}

int main(int argc, char **argv) {
    int count = argc == 2 ? atoi(argv[1]) : 0;
    if (count < 1 || count > MOST) {
        fprintf(stderr, "usage: gripper COUNT (1..%d)\n", MOST);
        return 2;
    }
    struct rlimit limit;
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    int epoll = epoll_create1(0);
    for (int gripper = 0; gripper < count; gripper++) {
        begin(gripper);
        watch(epoll, listen_on_loopback(gripper));
    }
    printf("\n");
    fflush(stdout);
    watch(epoll, STDIN_FILENO);
    for (;;) {
        struct epoll_event events[256];
        int ready = epoll_wait(epoll, events, 256, -1);
        for (int i = 0; i < ready; i++) {
            int fd = events[i].data.fd;
            if (fd == STDIN_FILENO)
                return 0;
            if (listens[fd])
                admit(epoll, fd);
            else
                serve(fd);
        }
    }
}
