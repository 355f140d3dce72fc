// A robot for tests, on a ROS master: the simulated rover's world behind libroscpp. It publishes panorama, depth_front
// … depth_right, and odom (with wheels that report 1 % too much), obeys cmd_vel, and stops without a command for half a
// second. Where the panorama's and the front depth camera are is said by tf alone: on a mast, the latter by messages
// that come again and again, as of a head that turns.
//
//   ros-rover CALIBRATION.json TRUTH.txt        writes its calibration first; then, 20 times a second, a line
//                                               "seconds x y heading speed touched" of what is true
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic" // C headers: compound literals
extern "C" {
#include "surround/drive/simulated_rover.h"
}
#pragma GCC diagnostic pop

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <string>
#include <tf2_msgs/TFMessage.h>
#include <vector>

namespace
{

constexpr int CAMERAS = 4, PANORAMA_HEIGHT = 128;
const char *const names[CAMERAS] = {"front", "left", "back", "right"};

const struct pose body_from_mast = {{0, 0, 0.6, 0.8}, {-0.1, 0.05, 0.4}};

geometry_msgs::TransformStamped transform(const char *parent, const char *child, struct pose parent_from_child)
{
    geometry_msgs::TransformStamped out;
    out.header.stamp = ros::Time::now();
    out.header.frame_id = parent;
    out.child_frame_id = child;
    out.transform.translation.x = parent_from_child.translation.x;
    out.transform.translation.y = parent_from_child.translation.y;
    out.transform.translation.z = parent_from_child.translation.z;
    out.transform.rotation.x = parent_from_child.rotation.x;
    out.transform.rotation.y = parent_from_child.rotation.y;
    out.transform.rotation.z = parent_from_child.rotation.z;
    out.transform.rotation.w = parent_from_child.rotation.w;
    return out;
}

struct robot {
    struct rover_options how = rover_default_options();
    struct box_world world;
    struct pose body, odometry;
    struct link_watch watch = {};
    struct drive_command heard = {}, carried = {};
    bool touched = false;
    uint32_t images = 0;
    ros::Publisher panorama, odom, depth[CAMERAS], places, rigid_places;

    robot() : how(rover_default_options())
    {
        how.depth_width = 160;
        how.depth_height = 120;
        watch.patience_s = 0.5;
        rover_stage_world(3, &world, &body);
        odometry = body;
    }

    void on_command(const geometry_msgs::TwistConstPtr &m)
    {
        heard.speed = m->linear.x;
        heard.turn_rate = m->angular.z;
        watch.heard = true;
        watch.heard_ns = static_cast<int64_t>(ros::Time::now().toNSec());
    }

    void drive(double seconds)
    {
        bool lost;
        carried = link_watch_command(&watch, heard, static_cast<int64_t>(ros::Time::now().toNSec()), &lost);
        const struct pose moved = robot_motion_after(body, carried, seconds);
        touched = touched || box_world_clearance(&world, moved, how.size_m) <= 0;
        if (touched)
            return;
        body = moved;
        struct drive_command reported = carried;
        reported.speed *= 1.01;
        odometry = robot_motion_after(odometry, reported, seconds);
    }

    void publish_odometry()
    {
        nav_msgs::Odometry m;
        m.header.stamp = ros::Time::now();
        m.child_frame_id = "chassis";
        m.pose.pose.position.x = odometry.translation.x;
        m.pose.pose.position.y = odometry.translation.y;
        m.pose.pose.orientation.z = odometry.rotation.z;
        m.pose.pose.orientation.w = odometry.rotation.w;
        odom.publish(m);
    }

    void publish_rigid_places()
    {
        tf2_msgs::TFMessage m;
        m.transforms.push_back(transform("chassis", "mast", body_from_mast));
        m.transforms.push_back(transform("mast", "head", pose_multiply(pose_inverse(body_from_mast), rover_head())));
        rigid_places.publish(m);
    }

    void publish_places()
    {
        tf2_msgs::TFMessage m;
        m.transforms.push_back(
            transform("mast", "eye_front", pose_multiply(pose_inverse(body_from_mast), rover_depth_camera(0))));
        places.publish(m);
    }

    void publish_images()
    {
        sensor_msgs::Image m;
        m.header.stamp = ros::Time::now();
        m.header.frame_id = "head";
        m.height = PANORAMA_HEIGHT;
        m.width = 2 * PANORAMA_HEIGHT;
        m.encoding = "rgb8";
        m.step = m.width * 3;
        m.data.resize(m.step * m.height);
        box_world_panorama(&world, pose_multiply(body, rover_head()), static_cast<int>(m.width), PANORAMA_HEIGHT,
                           m.data.data());
        panorama.publish(m);
        const struct lens lens = rover_depth_lens(&how);
        std::vector<uint16_t> mm(static_cast<size_t>(lens.width) * static_cast<size_t>(lens.height));
        for (int c = 0; c < CAMERAS; c++) {
            box_world_depth(&world, pose_multiply(body, rover_depth_camera(c)), &lens, ROVER_RANGE_M, ++images,
                            mm.data());
            m.height = static_cast<uint32_t>(lens.height);
            m.width = static_cast<uint32_t>(lens.width);
            m.encoding = "16UC1";
            m.header.frame_id = std::string("eye_") + names[c]; // tf knows the first
            m.step = m.width * 2;
            const uint8_t *bytes = reinterpret_cast<const uint8_t *>(mm.data());
            m.data.assign(bytes, bytes + m.step * m.height);
            depth[c].publish(m);
        }
    }

    // True: written.
    bool write_truth(const char *path) const
    {
        const std::string part = std::string(path) + ".part";
        FILE *to = fopen(part.c_str(), "w");
        if (!to)
            return false;
        fprintf(to, "%.3f %.6f %.6f %.6f %.4f %d\n", ros::Time::now().toSec(), body.translation.x, body.translation.y,
                2 * std::atan2(body.rotation.z, body.rotation.w), carried.speed, touched);
        return fclose(to) == 0 && rename(part.c_str(), path) == 0;
    }
};

void add_lens(FILE *to, const struct lens &lens)
{
    fprintf(to, "\"width\": %d, \"height\": %d, \"fx\": %.6f, \"fy\": %.6f, \"cx\": %.3f, \"cy\": %.3f", lens.width,
            lens.height, lens.fx, lens.fy, lens.cx, lens.cy);
}

void add_motion(FILE *to, struct pose p)
{
    double m[3][3];
    quat_to_matrix(p.rotation, m);
    const double t[3] = {p.translation.x, p.translation.y, p.translation.z};
    fprintf(to, ", \"body_from_camera\": [");
    for (int i = 0; i < 3; i++)
        fprintf(to, "[%.9f, %.9f, %.9f, %.9f], ", m[i][0], m[i][1], m[i][2], t[i]);
    fprintf(to, "[0, 0, 0, 1]]");
}

bool write_calibration(const struct rover_options &how, const char *path)
{
    FILE *to = fopen(path, "w");
    if (!to)
        return false;
    fprintf(to, "{\"body\": {\"length_m\": %.3f, \"width_m\": %.3f, \"height_m\": %.3f},\n", how.size_m[0],
            how.size_m[1], how.size_m[2]);
    fprintf(to, "\"panorama\": {\"projection\": \"equirectangular\"");
    fprintf(to, "},\n\"view\": {");
    add_lens(to, how.view);
    fprintf(to, "},\n\"depth\": {");
    for (int c = 0; c < CAMERAS; c++) {
        fprintf(to, "%s\"%s\": {", c ? ",\n" : "", names[c]);
        add_lens(to, rover_depth_lens(&how));
        if (c)
            add_motion(to, rover_depth_camera(c));
        fprintf(to, "}");
    }
    fprintf(to, "}}\n");
    return fclose(to) == 0;
}

} // namespace

int main(int argc, char **argv)
{
    robot r;
    ros::init(argc, argv, "rover", ros::init_options::NoRosout);
    if (argc < 3 || argc > 4 || !write_calibration(r.how, argv[1]))
        return 2;
    if (argc == 4)
        r.watch.patience_s = std::atof(argv[3]); // without a command it drives on for so long
    ros::NodeHandle node;
    const ros::Subscriber commands = node.subscribe("cmd_vel", 1, &robot::on_command, &r);
    r.panorama = node.advertise<sensor_msgs::Image>("panorama", 1);
    r.odom = node.advertise<nav_msgs::Odometry>("odom", 100);
    for (int c = 0; c < CAMERAS; c++)
        r.depth[c] = node.advertise<sensor_msgs::Image>(std::string("depth_") + names[c], 1);
    r.places = node.advertise<tf2_msgs::TFMessage>("/tf", 100);
    r.rigid_places = node.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
    r.publish_rigid_places();
    ros::Rate rate(20);
    for (int i = 0; ros::ok(); i++) {
        ros::spinOnce();
        r.drive(0.05);
        r.publish_odometry();
        r.publish_places();
        if (i % 4 == 0)
            r.publish_images();
        if (!r.write_truth(argv[2]))
            return 1;
        rate.sleep();
    }
    return 0;
}
