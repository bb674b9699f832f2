/* The controller in C: `controller PORT RATE SAMPLES OUT` runs the exported law on a clock.
 *
 * It writes OUT, all float64: whether memory is locked and SCHED_FIFO is permitted, the last answer of the robot, then for each cycle the
 * times at which it began and at which its command was sent, both in s after the deadline.
 */
#define _GNU_SOURCE
#include "law.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define START (-1.0)


/* The present time minus `deadline`, s. */
static double after(const struct timespec *deadline)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)(now.tv_sec - deadline->tv_sec) + 1e-9 * (double)(now.tv_nsec - deadline->tv_nsec);
}

static void advance(struct timespec *t, long nanoseconds)
{
    t->tv_nsec += nanoseconds;
    while (t->tv_nsec >= 1000000000L) {
        t->tv_nsec -= 1000000000L;
        t->tv_sec += 1;
    }
}

static int reserve(void)
{
    struct sched_param priority = {.sched_priority = 80};
    return sched_setscheduler(0, SCHED_FIFO, &priority) == 0;
}

/* A socket to the robot. It waits up to 5 s for an answer. */
static int connected(int port)
{
    struct timeval patience = {.tv_sec = 5};
    struct sockaddr_in robot;
    int channel = socket(AF_INET, SOCK_DGRAM, 0);

    memset(&robot, 0, sizeof robot);
    robot.sin_family = AF_INET;
    robot.sin_port = htons((unsigned short)port);
    robot.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (channel < 0 || setsockopt(channel, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) != 0
        || connect(channel, (struct sockaddr *)&robot, sizeof robot) != 0) {
        perror("controller: no socket");
        exit(1);
    }
    return channel;
}

static void receive(int channel, double *state, double expected)
{
    const ssize_t size = (1 + 2 * LAW_N) * sizeof(double);
    if (recv(channel, state, (size_t)size, 0) != size || state[0] != expected) {
        fprintf(stderr, "controller: no answer %g of the robot\n", expected);
        exit(1);
    }
}

static void send_command(int channel, const double *command)
{
    const ssize_t size = (1 + LAW_N) * sizeof(double);
    if (send(channel, command, (size_t)size, 0) != size) {
        perror("controller: the command was not sent");
        exit(1);
    }
}

int main(int count, char **arguments)
{
    double command[1 + LAW_N] = {START}, state[1 + 2 * LAW_N], permitted[2], *late, *done;
    struct timespec deadline;
    law_state law;
    long samples, k;
    double rate, dt;
    int channel;
    FILE *out;

    if (count != 5) {
        fprintf(stderr, "usage: controller PORT RATE SAMPLES OUT\n");
        return 2;
    }
    rate = atof(arguments[2]);
    dt = 1.0 / rate;
    samples = atol(arguments[3]);
    late = calloc((size_t)samples, sizeof *late);
    done = calloc((size_t)samples, sizeof *done);
    if (late == NULL || done == NULL)
        return 1;
    channel = connected(atoi(arguments[1]));
    permitted[0] = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    permitted[1] = reserve();

    law_init(&law);
    send_command(channel, command);
    clock_gettime(CLOCK_MONOTONIC, &deadline);
    advance(&deadline, 50000000L);
    for (k = 0; k < samples; k++) {
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, NULL) == EINTR)
            ;
        late[k] = after(&deadline);
        receive(channel, state, (double)k);
        command[0] = (double)k;
        if (law_step(&law, (double)k * dt, state + 1, state + 1 + LAW_N, command + 1) != LAW_OK) {
            fprintf(stderr, "controller: the law has no answer at %g s\n", (double)k * dt);
            return 1;
        }
        send_command(channel, command);
        done[k] = after(&deadline);
        advance(&deadline, (long)(1e9 * dt));
    }
    receive(channel, state, (double)samples);

    out = fopen(arguments[4], "wb");
    if (out == NULL || fwrite(permitted, sizeof(double), 2, out) != 2
        || fwrite(state, sizeof(double), 1 + 2 * LAW_N, out) != 1 + 2 * LAW_N
        || fwrite(late, sizeof(double), (size_t)samples, out) != (size_t)samples
        || fwrite(done, sizeof(double), (size_t)samples, out) != (size_t)samples || fclose(out) != 0) {
        perror("controller: the results were not written");
        return 1;
    }
    return close(channel);
}
