// See ros_robot.h. Nothing of libroscpp's is named outside this file but by the test's own robot.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic" // C headers: compound literals
extern "C" {
#include "platform/network/ros_robot.h"

#include "platform/files/jpeg.h"
#include "platform/network/ros_guard.h"
}
#include "base/pixels.h"
#pragma GCC diagnostic pop

#ifdef REENACT_ROS
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <geometry_msgs/Twist.h>
#include <mutex>
#include <nav_msgs/Odometry.h>
#include <new>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <string>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>
#include <thread>
#include <vector>

namespace
{

const char *const topic_names[ROS_IMAGE_TOPICS] = {"panorama", "depth_front", "depth_left", "depth_back",
                                                   "depth_right"};
constexpr double REACHED_S = 0.1; // for a last command to reach the socket, chosen by hand
// How long a command that moves is valid: less than the half second after which a robot with a watchdog stops, more
// than the slowest picture between two commands where the processor draws. Chosen by hand.
constexpr std::chrono::milliseconds VALID(400);

int64_t time_of(const ros::Time &t) { return static_cast<int64_t>(t.toNSec()); }

// 32FC1: metres to millimetres; what is no distance is 0.
uint16_t millimetres(const uint8_t *from)
{
    float m;
    memcpy(&m, from, sizeof m);
    return m > 0 && m < 65.5f ? static_cast<uint16_t>(std::lround(m * 1e3f)) : 0;
}

} // namespace

struct ros_robot {
    ros::CallbackQueue queue;
    ros::NodeHandle node;
    std::vector<ros::Subscriber> subscribers;
    ros::Publisher commands;
    tf2::BufferCore places;
    std::string body = "base_link";          // odometry says if it is another
    const struct ros_receiver *to = nullptr; // while polling
    std::vector<uint8_t> rgb;
    std::vector<uint16_t> depth;
    int64_t refused = 0;
    // Stops the robot where commands cease because the program hangs: a thread, which does not hang with it.
    // It also tells the guard that this program lives: that stops the robot where this thread cannot either.
    struct ros_guard *const guard;
    std::mutex lock; // of all below
    std::condition_variable changed;
    std::chrono::steady_clock::time_point sent;
    bool moves = false, closing = false;
    bool interrupted = false; // the guard has stopped the robot, which ros_robot_interrupted has not told yet
    bool unguarded = false;
    std::thread watchdog;

    explicit ros_robot(struct ros_guard *g) : guard(g)
    {
        node.setCallbackQueue(&queue);
        for (int i = 0; i < ROS_IMAGE_TOPICS; i++) {
            const boost::function<void(const sensor_msgs::ImageConstPtr &)> on_image =
                [this, i](const sensor_msgs::ImageConstPtr &m) { take(static_cast<enum ros_topic>(i), *m); };
            subscribers.push_back(node.subscribe<sensor_msgs::Image>(topic_names[i], 1, on_image));
        }
        const boost::function<void(const sensor_msgs::CompressedImageConstPtr &)> on_jpeg =
            [this](const sensor_msgs::CompressedImageConstPtr &m) { take_jpeg(*m); };
        subscribers.push_back(node.subscribe<sensor_msgs::CompressedImage>("panorama/compressed", 1, on_jpeg));
        const boost::function<void(const nav_msgs::OdometryConstPtr &)> on_odometry =
            [this](const nav_msgs::OdometryConstPtr &m) { take_odometry(*m); };
        subscribers.push_back(node.subscribe<nav_msgs::Odometry>("odom", 100, on_odometry));
        for (const bool is_static : {false, true}) {
            const boost::function<void(const tf2_msgs::TFMessageConstPtr &)> on_places =
                [this, is_static](const tf2_msgs::TFMessageConstPtr &m) { take_places(*m, is_static); };
            subscribers.push_back(
                node.subscribe<tf2_msgs::TFMessage>(is_static ? "/tf_static" : "/tf", 100, on_places));
        }
        commands = node.advertise<geometry_msgs::Twist>("cmd_vel", 1);
        watchdog = std::thread([this] { watch(); });
    }

    ~ros_robot()
    {
        {
            const std::lock_guard<std::mutex> held(lock);
            closing = true;
        }
        changed.notify_all();
        watchdog.join();
        struct ros_guard *ended = guard;
        ros_guard_end(&ended);
    }

    ros_robot(const ros_robot &) = delete;
    ros_robot &operator=(const ros_robot &) = delete;

    void publish(double speed, double turn_rate)
    {
        geometry_msgs::Twist twist;
        twist.linear.x = speed;
        twist.angular.z = turn_rate;
        commands.publish(twist);
        sent = std::chrono::steady_clock::now();
        moves = speed != 0 || turn_rate != 0;
    }

    // Nothing that moves is sent unguarded, nor after the guard's stop before the operator's side knows of it.
    void send(double speed, double turn_rate)
    {
        const std::lock_guard<std::mutex> held(lock);
        beat();
        const bool may = !interrupted && !unguarded;
        publish(may ? speed : 0, may ? turn_rate : 0);
    }

    void beat()
    {
        const enum ros_guard_word said = ros_guard_beat(guard);
        interrupted |= said == GUARD_STOPPED;
        unguarded |= said == GUARD_GONE;
    }

    void watch()
    {
        std::unique_lock<std::mutex> held(lock);
        while (!closing) {
            beat();
            if (moves && (interrupted || unguarded || std::chrono::steady_clock::now() - sent > VALID)) {
                moves = false;
                try {
                    publish(0, 0);
                } catch (const std::exception &) { // the robot's own watchdog is left
                }
            }
            changed.wait_for(held, std::chrono::milliseconds(ROS_GUARD_BEAT_MS));
        }
    }

    void refuse() { refused++; }

    void take_places(const tf2_msgs::TFMessage &m, bool is_static)
    {
        for (const auto &place : m.transforms)
            if (!places.setTransform(place, "reenact", is_static)) // not finite, no rotation, or older than ten seconds
                refuse();
    }

    // What tf knows of the place of an image's camera.
    void place(const std_msgs::Header &header, struct ros_image *out) const
    {
        try {
            const bool then = places.canTransform(body, header.frame_id, header.stamp);
            const auto t = places.lookupTransform(body, header.frame_id, then ? header.stamp : ros::Time(0)).transform;
            out->body_from_camera = {quat_unit({t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w}),
                                     {t.translation.x, t.translation.y, t.translation.z}};
            out->placed = true;
        } catch (const tf2::TransformException &) { // it is not known, or the image names no frame
            out->placed = false;
        }
    }

    // Bytes of a pixel of an encoding that is understood; 0: none.
    static size_t pixel_bytes(const sensor_msgs::Image &m, bool depth)
    {
        if (depth)
            return m.is_bigendian                                    ? 0
                   : m.encoding == "16UC1" || m.encoding == "mono16" ? 2
                   : m.encoding == "32FC1"                           ? 4
                                                                     : 0;
        return m.encoding == "rgb8" || m.encoding == "bgr8"     ? 3
               : m.encoding == "rgba8" || m.encoding == "bgra8" ? 4
                                                                : 0;
    }

    void take(enum ros_topic topic, const sensor_msgs::Image &m)
    {
        const bool is_depth = topic != ROS_PANORAMA;
        const size_t bytes = pixel_bytes(m, is_depth), width = m.width, height = m.height;
        if (!to || !bytes || !image_size_is_usable(m.width, m.height) || m.step < width * bytes ||
            m.data.size() < (height - 1) * m.step + width * bytes)
            return refuse();
        struct ros_image out = {};
        out.topic = topic;
        out.time_ns = time_of(m.header.stamp);
        out.width = static_cast<int>(width);
        out.height = static_cast<int>(height);
        place(m.header, &out);
        if (is_depth) {
            depth.resize(width * height);
            for (size_t v = 0; v < height; v++)
                for (size_t u = 0; u < width; u++) {
                    const uint8_t *from = &m.data[v * m.step + u * bytes];
                    depth[v * width + u] =
                        bytes == 4 ? millimetres(from) : static_cast<uint16_t>(from[0] | from[1] << 8);
                }
            out.depth = depth.data();
        } else {
            const bool bgr = m.encoding[0] == 'b';
            const enum packed_order order =
                bytes == 3 ? (bgr ? PACKED_BGR : PACKED_RGB) : (bgr ? PACKED_BGRX : PACKED_RGBX);
            rgb.resize(width * height * 3);
            pixels_from_packed(m.data.data(), m.step, order, out.width, out.height, rgb.data());
            out.rgb = rgb.data();
        }
        to->image(to->self, &out);
    }

    void take_jpeg(const sensor_msgs::CompressedImage &m)
    {
        struct ros_image out = {};
        out.topic = ROS_PANORAMA;
        out.time_ns = time_of(m.header.stamp);
        place(m.header, &out);
        if (!to || jpeg_size(m.data.data(), m.data.size(), &out.width, &out.height) != OK)
            return refuse();
        rgb.resize(static_cast<size_t>(out.width) * static_cast<size_t>(out.height) * 3);
        if (jpeg_decode(m.data.data(), m.data.size(), rgb.data(), out.width, out.height) != OK)
            return refuse();
        out.rgb = rgb.data();
        to->image(to->self, &out);
    }

    void take_odometry(const nav_msgs::Odometry &m)
    {
        const auto &p = m.pose.pose.position;
        const auto &q = m.pose.pose.orientation;
        const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
        const struct pose pose = {{q.x / length, q.y / length, q.z / length, q.w / length}, {p.x, p.y, p.z}};
        if (!to || !(std::fabs(length - 1) < 0.01) || !v3_finite(pose.translation))
            return refuse();
        if (!m.child_frame_id.empty())
            body = m.child_frame_id;
        to->odometry(to->self, time_of(m.header.stamp), &pose);
    }
};

namespace
{

// The robot that is open, for when the process ends without closing it: a display that is gone ends it so (Xlib).
struct ros_robot *driven;

void stop_at_exit(void)
{
    if (!driven)
        return;
    ros_robot_command(driven, 0, 0);
    try {
        ros::WallDuration(REACHED_S).sleep();
    } catch (const std::exception &) { // there is nothing left to do about it
    }
}

enum status open_robot(struct ros_robot **out, struct ros_guard **guard, const char *master, const char *const *remap)
{
    enum status status = ros_guard_start(guard, master, remap);
    if (status == OK)
        status = ros_node_start("reenact_drive", master, remap);
    if (status == OK)
        status = ros_guard_wait(*guard);
    if (status != OK)
        return status;
    *out = driven = new ros_robot(*guard);
    *guard = nullptr;          // the robot's from here
    std::atexit(stop_at_exit); // after ROS's own, so that it comes before it
    return OK;
}

enum status open_guarded(struct ros_robot **out, const char *master, const char *const *remap)
{
    struct ros_guard *guard = nullptr;
    enum status status = OK;
    try {
        status = open_robot(out, &guard, master, remap);
    } catch (const std::bad_alloc &) {
        status = fail(ERR_MEMORY, "out of memory");
    } catch (const std::exception &e) {
        status = fail(ERR_INPUT, "the robot's address or topics are not as ROS wants them (%s)", e.what());
    }
    ros_guard_end(&guard);
    return status;
}

} // namespace

bool ros_robot_available(void) { return true; }

enum status ros_robot_open(struct ros_robot **out, const char *master, const char *const *remap)
{
    *out = nullptr;
    return open_guarded(out, master, remap);
}

void ros_robot_close(struct ros_robot **r)
{
    if (!*r)
        return;
    try {
        driven = nullptr;
        ros::WallDuration(REACHED_S).sleep();
        delete *r;
        ros::shutdown();
    } catch (const std::exception &) { // there is nothing left to do about it
    }
    *r = nullptr;
}

enum status ros_robot_poll(struct ros_robot *r, const struct ros_receiver *to)
{
    try {
        r->to = to;
        r->queue.callAvailable(ros::WallDuration(0));
        r->to = nullptr;
        const std::lock_guard<std::mutex> held(r->lock);
        if (r->unguarded)
            return fail(ERR_IO,
                        "the process that stops the robot if this program dies (%s) has ended or hangs; the "
                        "robot was sent a stop",
                        ros_guard_name);
        return ros::ok() ? OK : fail(ERR_IO, "the ROS node was shut down from outside");
    } catch (const std::bad_alloc &) {
        r->to = nullptr;
        return fail(ERR_MEMORY, "out of memory");
    } catch (const std::exception &e) {
        r->to = nullptr;
        return fail(ERR_IO, "the robot cannot be driven (ROS: %s)", e.what());
    }
}

void ros_robot_command(struct ros_robot *r, double speed, double turn_rate)
{
    try {
        r->send(speed, turn_rate);
    } catch (const std::exception &) { // the next one follows; without any the robot stops
    }
}

bool ros_robot_interrupted(struct ros_robot *r)
{
    const std::lock_guard<std::mutex> held(r->lock);
    const bool interrupted = r->interrupted;
    r->interrupted = false;
    return interrupted;
}

int64_t ros_robot_refused(const struct ros_robot *r) { return r->refused; }

#else

bool ros_robot_available(void) { return false; }

enum status ros_robot_open(struct ros_robot **out, const char *, const char *const *)
{
    *out = nullptr;
    return fail(ERR_INPUT, "this program was built without ROS: install libroscpp-dev, libsensor-msgs-dev, "
                           "libnav-msgs-dev, libgeometry-msgs-dev and libtf2-dev, and build again");
}

void ros_robot_close(struct ros_robot **r) { *r = nullptr; }
enum status ros_robot_poll(struct ros_robot *, const struct ros_receiver *) { return OK; }
void ros_robot_command(struct ros_robot *, double, double) {}
bool ros_robot_interrupted(struct ros_robot *) { return false; }
int64_t ros_robot_refused(const struct ros_robot *) { return 0; }

#endif
