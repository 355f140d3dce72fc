#include "tests/support/test.h"

#include "tests/support/ros_stage.h"

#include "base/clock.h"
#include "platform/network/ros_robot.h"
#include "tests/support/process.h"

#include <arpa/inet.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#define MASTER "/usr/bin/rosmaster"
enum { PATIENCE = 30 * 20 /* of 50 ms: a busy machine is slow, not wrong */ };

bool ros_stage_available(void) { return ros_robot_available() && !access(MASTER, X_OK); }

static int free_port(void)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    const int s = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(s, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(getsockname(s, (struct sockaddr *)&at, &size), 0);
    close(s);
    return ntohs(at.sin_port);
}

static bool answers(int port)
{
    const struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int s = socket(AF_INET, SOCK_STREAM, 0);
    const bool good = connect(s, (const struct sockaddr *)&at, sizeof at) == 0;
    close(s);
    return good;
}

bool ros_stage_read(struct ros_stage *r)
{
    FILE *from = fopen(r->truth, "r");
    if (!from)
        return false;
    const int n = fscanf(from, "%lf %lf %lf %lf %lf %d", &r->is.seconds, &r->is.x, &r->is.y, &r->is.heading,
                         &r->is.speed, &r->is.touched);
    fclose(from);
    return n == 6;
}

static void wait_a_little(void) { clock_sleep_until_ns(clock_now_ns() + 50000000); }

void ros_stage_open(struct ros_stage *r, const char *robot, const char *patience_s)
{
    char port[16];
    const int number = free_port();
    *r = (struct ros_stage){.folder = "/tmp/ros-drive-XXXXXX"};
    assert_non_null(mkdtemp(r->folder));
    snprintf(r->calibration, sizeof r->calibration, "%s/calibration.json", r->folder);
    snprintf(r->truth, sizeof r->truth, "%s/truth.txt", r->folder);
    snprintf(r->uri, sizeof r->uri, "ros:http://127.0.0.1:%d", number);
    snprintf(port, sizeof port, "%d", number);
    setenv("ROS_MASTER_URI", r->uri + 4, 1);
    setenv("ROS_IP", "127.0.0.1", 1);
    setenv("ROS_HOME", r->folder, 1);
    setenv("ROS_LOG_DIR", r->folder, 1);
    r->master = process_start((const char *const[]){MASTER, "--core", "-p", port, NULL});
    for (int i = 0; i < PATIENCE && !answers(number); i++)
        wait_a_little();
    r->rover = process_start((const char *const[]){robot, r->calibration, r->truth, patience_s, NULL});
    for (int i = 0; i < PATIENCE && !ros_stage_read(r); i++)
        wait_a_little();
}

static void end_process(pid_t process)
{
    if (process <= 0) // it was not started
        return;
    kill(process, SIGKILL);
    waitpid(process, NULL, 0);
}

void ros_stage_close(struct ros_stage *r)
{
    char command[128];
    end_process(r->rover);
    end_process(r->master);
    snprintf(command, sizeof command, "rm -rf %s", r->folder);
    if (*r->folder && system(command))
        print_error("%s is left\n", r->folder);
    *r = (struct ros_stage){0};
}
