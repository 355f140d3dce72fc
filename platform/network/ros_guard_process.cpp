// The guard itself; see ros_guard.h.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic" // C headers: compound literals
extern "C" {
#include "base/clock.h"
#include "platform/network/ros_guard.h"
}
#pragma GCC diagnostic pop

#ifdef REENACT_ROS
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <geometry_msgs/Twist.h>
#include <poll.h>
#include <ros/ros.h>
#include <string>
#include <sys/socket.h>
#include <unistd.h>

enum status ros_node_start(const char *name, const char *master, const char *const *remap)
{
    ros::M_string names;
    for (; remap && *remap; remap++) {
        const char *colon = strstr(*remap, ":=");
        if (!colon || colon == *remap || !colon[2])
            return fail(ERR_INPUT, "'%s' renames no topic; give FROM:=TO", *remap);
        names[std::string(*remap, colon)] = colon + 2;
    }
    if (*master)
        names["__master"] = master;
    ros::init(names, name,
              ros::init_options::NoSigintHandler | ros::init_options::AnonymousName | ros::init_options::NoRosout);
    if (!ros::master::check())
        return fail(ERR_IO, "no ROS master answers at %s; is roscore running there?", ros::master::getURI().c_str());
    ros::master::setRetryTimeout(ros::WallDuration(2));
    return OK;
}

namespace
{

constexpr int64_t MS = 1000000; // nanoseconds

class guard
{
    ros::NodeHandle node;
    ros::Publisher commands = node.advertise<geometry_msgs::Twist>("cmd_vel", 1);
    bool beaten = false, closed = false, farewell = false;
    int64_t beat_ns = 0;
    bool failed = false;
    int64_t failed_ns = 0, published_ns = 0;

    static void say(char word) { (void)send(GUARD_CHANNEL, &word, 1, MSG_NOSIGNAL | MSG_DONTWAIT); }

    // What the program has said until now.
    void listen(int64_t now_ns)
    {
        char word;
        ssize_t got;
        while ((got = recv(GUARD_CHANNEL, &word, 1, MSG_DONTWAIT)) == 1) {
            farewell |= word == GUARD_BYTE_FAREWELL;
            beaten = true;
            beat_ns = now_ns;
            failed = false;
        }
        closed |= got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR);
    }

    void wait(int64_t until_ns) const
    {
        const int64_t left_ms = (until_ns - clock_now_ns() + MS - 1) / MS;
        struct pollfd channel = {GUARD_CHANNEL, POLLIN, 0};
        poll(&channel, closed ? 0 : 1, static_cast<int>(std::max<int64_t>(left_ms, 0)));
    }

    bool stops(int64_t now_ns) const { return failed && now_ns - failed_ns < ROS_GUARD_STOP_MS * MS; }

    void look(int64_t now_ns)
    {
        if (failed || !beaten || (!closed && now_ns - beat_ns < ROS_GUARD_SILENT_MS * MS))
            return;
        failed = true;
        failed_ns = now_ns;
        published_ns = 0;
        say(GUARD_BYTE_STOPPED);
    }

  public:
    void run()
    {
        say(GUARD_BYTE_READY);
        while (ros::ok()) {
            const int64_t now_ns = clock_now_ns();
            listen(now_ns);
            look(now_ns);
            if (farewell || (closed && !stops(now_ns)))
                return;
            if (stops(now_ns) && now_ns - published_ns >= ROS_GUARD_REPEAT_MS * MS) {
                commands.publish(geometry_msgs::Twist());
                published_ns = now_ns;
            }
            // Until it has to look or publish again; what the program says wakes it before.
            wait(stops(now_ns)       ? published_ns + ROS_GUARD_REPEAT_MS * MS
                 : beaten && !failed ? beat_ns + ROS_GUARD_SILENT_MS * MS
                                     : now_ns + 1000 * MS);
        }
    }
};

[[noreturn]] void run_guard(const char *master, const char *const *remap)
{
    for (const int ending : {SIGTERM, SIGINT, SIGHUP})
        signal(ending, SIG_IGN);
    try {
        if (ros_node_start("reenact_drive_guard", master, remap) == OK) {
            guard().run();
            ros::shutdown();
        }
    } catch (const std::exception &) { // the program sees that it has ended, and says so
    }
    _exit(0);
}

__attribute__((constructor)) void guard_if_asked(int argc, char **argv)
{
    if (argc >= 2 && !strcmp(argv[0], ros_guard_name))
        run_guard(argv[1], argv + 2);
}

} // namespace

#endif
