#include "surround/drive/ros_rover.h"

#include <stdlib.h>
#include <string.h>

#define TOGETHER_NS 150000000   // a depth image this near to a panorama is of its instant, but for the odometry between
#define SILENT_NS   1000000000  // a depth camera without an image for so long is not waited for
#define UNPLACED_NS 10000000000 // so long tf is waited for
enum { DEPTH_STEP = 2 };

enum status ros_rover_open(struct ros_rover *rover, const char *master, const char *const *remap,
                           const char *calibration, double patience_s)
{
    *rover = (struct ros_rover){.patience_ns = llround(patience_s * 1e9), .behind_ns = INT64_MAX};
    enum status status = surround_rig_read(&rover->rig, calibration);
    if (status == OK)
        status = surroundings_open_live(&rover->surroundings, SURROUNDINGS_ROBOT, &rover->rig.view,
                                        rover->rig.body_from_panorama, NULL);
    if (status == OK)
        status = ros_robot_open(&rover->link, master, remap);
    if (status != OK)
        ros_rover_close(rover);
    return status;
}

void ros_rover_close(struct ros_rover *rover)
{
    if (rover->link)
        ros_robot_command(rover->link, 0, 0);
    ros_robot_close(&rover->link);
    surroundings_close(&rover->surroundings);
    surround_set_free(&rover->rig);
    for (int i = 0; i < ROS_IMAGE_TOPICS; i++)
        free(rover->newest[i].pixels);
    *rover = (struct ros_rover){0};
}

// Width and height that the calibration gives a topic's images; false: it is not used.
static bool expected_size(const struct ros_rover *rover, enum ros_topic topic, int size[2])
{
    const struct lens *lens =
        topic == ROS_PANORAMA ? &rover->rig.panorama_lens : &rover->rig.depth_cameras[topic - ROS_DEPTH_FRONT].lens;
    size[0] = lens->width;
    size[1] = lens->height;
    return lens->width > 0;
}

// Where an image was taken; false: nothing says it (yet).
static bool place_image(struct ros_rover *rover, const struct ros_image *image, struct pose *out)
{
    static const char *const names[ROS_IMAGE_TOPICS] = {"panorama", "depth_front", "depth_left", "depth_back",
                                                        "depth_right"};
    const bool is_panorama = image->topic == ROS_PANORAMA;
    const struct depth_camera *camera = &rover->rig.depth_cameras[is_panorama ? 0 : image->topic - ROS_DEPTH_FRONT];
    const bool calibrated = is_panorama ? rover->rig.panorama_placed : camera->placed;
    *out = image->body_from_camera;
    if (calibrated)
        *out = is_panorama ? rover->rig.body_from_panorama : camera->body_from_camera;
    if (calibrated || image->placed)
        return true;
    if (!rover->unplaced_ns)
        rover->unplaced_ns = rover->now_ns;
    if (rover->now_ns - rover->unplaced_ns > UNPLACED_NS)
        failure_keep(&rover->failure, fail(ERR_INPUT,
                                           "nothing says where the camera of %s is: the calibration has no "
                                           "body_from_camera for it, and tf does not know its images' frame_id",
                                           names[image->topic]));
    return false;
}

static void on_image(void *self, const struct ros_image *image)
{
    struct ros_rover *r = self;
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    const size_t bytes = image->rgb ? pixels * 3 : pixels * sizeof(uint16_t);
    int size[2];
    const bool used = expected_size(r, image->topic, size);
    const bool equirectangular = image->topic == ROS_PANORAMA && !used;
    if (!used && !equirectangular)
        return;
    if (equirectangular ? image->width != 2 * image->height : image->width != size[0] || image->height != size[1]) {
        failure_keep(&r->failure,
                     fail(ERR_INPUT, "the robot's %s images are of %d x %d pixels, which is not the calibration's",
                          image->rgb ? "colour" : "depth", image->width, image->height));
        return;
    }
    struct pose body_from_camera;
    if (!place_image(r, image, &body_from_camera))
        return;
    void *copy = malloc(bytes);
    if (!copy) {
        failure_keep(&r->failure, fail(ERR_MEMORY, "no memory for the robot's link"));
        return;
    }
    memcpy(copy, image->rgb ? (const void *)image->rgb : image->depth, bytes);
    free(r->newest[image->topic].pixels);
    r->newest[image->topic].pixels = copy;
    r->newest[image->topic].time_ns = image->time_ns;
    r->newest[image->topic].body_from_camera = body_from_camera;
    if (image->topic == ROS_PANORAMA) { // equirectangular images bring their size
        r->seen_ns = r->now_ns;
        r->panorama_width = image->width;
        r->panorama_height = image->height;
    }
}

static void on_odometry(void *self, int64_t time_ns, const struct pose *world_from_body)
{
    struct ros_rover *r = self;
    r->heard = true;
    r->heard_ns = r->now_ns;
    if (r->now_ns - time_ns < r->behind_ns)
        r->behind_ns = r->now_ns - time_ns;
    if (r->odometry_count && r->odometry[r->odometry_count - 1].time_ns >= time_ns)
        return;
    if (r->odometry_count == ROS_ROVER_ODOMETRY)
        memmove(r->odometry, r->odometry + 1, (size_t)--r->odometry_count * sizeof *r->odometry);
    r->odometry[r->odometry_count++] = (struct timed_pose){.time_ns = time_ns, .pose = *world_from_body};
}

static struct pose odometry_at(const struct ros_rover *rover, int64_t time_ns)
{
    return pose_list_at(rover->odometry, rover->odometry_count, time_ns);
}

// Whether the newest panorama can be captured: the odometry reaches past it, and every depth camera that still speaks
// has an image of its instant.
static bool is_complete(const struct ros_rover *rover)
{
    const int64_t at = rover->newest[ROS_PANORAMA].time_ns;
    if (!rover->newest[ROS_PANORAMA].pixels || at <= rover->captured_ns || !rover->odometry_count ||
        rover->odometry[0].time_ns > at || rover->odometry[rover->odometry_count - 1].time_ns < at)
        return false;
    int with_depth = 0;
    for (int c = 0; c < SURROUND_DEPTH_CAMERAS; c++) {
        const int topic = ROS_DEPTH_FRONT + c;
        const int64_t apart = rover->newest[topic].time_ns - at;
        if (!rover->rig.depth_cameras[c].lens.width || !rover->newest[topic].pixels || apart < -SILENT_NS)
            continue;
        if (apart < -TOGETHER_NS || apart > TOGETHER_NS ||
            apart > rover->odometry[rover->odometry_count - 1].time_ns - at)
            return false;
        with_depth++;
    }
    return with_depth > 0;
}

static enum status capture_surroundings(struct ros_rover *rover)
{
    const int64_t at = rover->newest[ROS_PANORAMA].time_ns;
    const struct pose odometry = odometry_at(rover, at);
    struct depth_points points = {0};
    struct surround_picture picture;
    uint8_t *rgb = rover->newest[ROS_PANORAMA].pixels;
    const bool perspective = rover->rig.panorama_lens.width > 0;
    struct lens ideal = rover->rig.panorama_lens;
    enum status status = OK;
    for (int c = 0; status == OK && c < SURROUND_DEPTH_CAMERAS; c++) {
        const struct depth_camera *camera = &rover->rig.depth_cameras[c];
        const int topic = ROS_DEPTH_FRONT + c;
        const int64_t time_ns = rover->newest[topic].time_ns;
        if (!camera->lens.width || !rover->newest[topic].pixels || time_ns < at - TOGETHER_NS)
            continue;
        const struct pose moved = pose_multiply(pose_inverse(odometry), odometry_at(rover, time_ns));
        status = depth_points_add(&points, rover->newest[topic].pixels, &camera->lens,
                                  pose_multiply(moved, rover->newest[topic].body_from_camera), DEPTH_STEP);
    }
    if (status == OK && perspective)
        status = surround_image_undistort(rgb, &ideal);
    if (status == OK) {
        rover->newest[ROS_PANORAMA].pixels = NULL; // the picture's from here
        status = surround_picture_make(&picture, rgb, rover->panorama_width, rover->panorama_height,
                                       perspective ? &ideal : NULL);
    }
    if (status == OK) {
        picture.time_ns = at;
        if (!rover->surroundings.any_taken)
            surroundings_place_panorama(&rover->surroundings, rover->newest[ROS_PANORAMA].body_from_camera);
        status = surroundings_take(&rover->surroundings, &picture, &points, odometry);
        rover->captured_ns = at;
    }
    depth_points_free(&points);
    return status;
}

static void send_command(struct ros_rover *rover, const struct drive_command *command)
{
    const bool lost = !rover->heard || rover->now_ns - rover->heard_ns > rover->patience_ns;
    rover->interrupted |= ros_robot_interrupted(rover->link);
    rover->stopped |= lost || rover->interrupted;
    rover->lost = lost;
    if (command && !lost && command->speed == 0 && command->turn_rate == 0)
        rover->stopped = rover->interrupted = false;
    const struct drive_command none = {0, 0};
    if (!command && !lost)
        return;
    rover->command = rover->stopped || !command ? none : *command;
    ros_robot_command(rover->link, rover->command.speed, rover->command.turn_rate);
}

enum status ros_rover_step(struct ros_rover *rover, int64_t now_ns, const struct drive_command *command)
{
    const struct ros_receiver to = {rover, on_image, on_odometry};
    rover->now_ns = now_ns;
    enum status status = ros_robot_poll(rover->link, &to);
    send_command(rover, command);
    if (status == OK)
        status = failure_restore(&rover->failure);
    if (status == OK && is_complete(rover) &&
        surroundings_wants(&rover->surroundings, odometry_at(rover, rover->newest[ROS_PANORAMA].time_ns),
                           rover->newest[ROS_PANORAMA].time_ns - rover->captured_ns))
        status = capture_surroundings(rover);
    return status;
}

struct pose ros_rover_pose(const struct ros_rover *rover)
{
    if (!rover->odometry_count)
        return POSE_IDENTITY;
    return surroundings_bridge(&rover->surroundings, rover->odometry[rover->odometry_count - 1].pose);
}

double ros_rover_age_s(const struct ros_rover *rover)
{
    return rover->captured_ns ? (double)(rover->now_ns - rover->behind_ns - rover->captured_ns) * 1e-9 : 0;
}

double ros_rover_silent_s(const struct ros_rover *rover) { return (double)(rover->now_ns - rover->seen_ns) * 1e-9; }
