#include "surround/drive/drive_session.h"

#include <string.h>

// A capture is asked for every 0.6 m (depth_alignment.h); by then two have not come. Of a ROS robot's panoramas, which
// come as often as it likes: what an operator waits for at a link that stutters.
#define STALE_M 1.5
#define STALE_S 3.0

struct drive_options drive_default_options(void) { return (struct drive_options){.patience_s = 0.5}; }

static bool is_delivered(void *self, int capture)
{
    const struct drive_session *s = self;
    return drive_link_delivers(&s->options.link, (uint32_t)capture);
}

static struct lens resize_lens(const struct lens *lens, const struct drive_options *options)
{
    struct lens out = *lens;
    if (options->width > 0 && options->height > 0) {
        const double scale = (double)options->width / lens->width;
        out.width = options->width;
        out.height = options->height;
        out.fx *= scale;
        out.fy *= scale;
        out.cx = (options->width - 1) / 2.0;
        out.cy = (options->height - 1) / 2.0;
    }
    return out;
}

static enum status open_simulated(struct drive_session *session, const char *stage)
{
    struct box_world world;
    struct pose start;
    struct rover_options options = rover_default_options();
    const int number = !*stage ? 3 : stage[1] ? 0 : stage[0] - '0';
    if (number < 1 || number > 3)
        return fail(ERR_INPUT, "sim: has the stages 1 (straight passage), 2 (bent passage) and 3 (a wall), not '%s'",
                    stage);
    options.view = resize_lens(&options.view, &session->options);
    rover_stage_world(number, &world, &start);
    return simulated_rover_open(&session->rover, &world, start, &options);
}

static enum status open_folder(struct drive_session *session, const char *folder)
{
    enum status status = surroundings_open(&session->played, folder, NULL);
    if (status != OK)
        return status;
    if (session->played.kind != SURROUNDINGS_ROBOT)
        return fail(ERR_INPUT, "%s holds no robot's captures (odometry.txt); for a vehicle's use reenact surround",
                    folder);
    session->played.delivers = is_delivered;
    session->played.delivers_self = session;
    session->first_ns = session->played.set.captures[0].time_ns;
    const struct lens lens = resize_lens(&session->played.set.view, &session->options);
    surround_view_close(&session->played.view);
    return surround_view_open(&session->played.view, &lens);
}

static enum status open_ros(struct drive_session *session, const char *master)
{
    if (!session->options.calibration)
        return fail(ERR_INPUT, "a ROS robot needs --calibration FILE: its lenses and where its cameras are, like the "
                               "calibration.json of a folder of captures");
    enum status status = ros_rover_open(&session->ros, master, session->options.remap, session->options.calibration,
                                        session->options.patience_s);
    if (status != OK)
        return status;
    const struct lens lens = resize_lens(&session->ros.rig.view, &session->options);
    surround_view_close(&session->ros.surroundings.view);
    return surround_view_open(&session->ros.surroundings.view, &lens);
}

const struct surroundings *drive_session_surroundings(const struct drive_session *session)
{
    switch (session->kind) {
    case DRIVE_SIMULATED: return &session->rover.surroundings;
    case DRIVE_PLAYED: return &session->played;
    default: return &session->ros.surroundings;
    }
}

static struct surroundings *seen_by(struct drive_session *session)
{
    switch (session->kind) {
    case DRIVE_SIMULATED: return &session->rover.surroundings;
    case DRIVE_PLAYED: return &session->played;
    default: return &session->ros.surroundings;
    }
}

enum status drive_session_open(struct drive_session *session, const char *uri, const struct drive_options *how)
{
    *session = (struct drive_session){.options = *how,
                                      .eye = {.viewpoint = VIEWPOINT_THIRD, .elevation = 0.8, .distance_m = 2}};
    session->watch.patience_s = how->patience_s;
    enum status status;
    if (!strncmp(uri, "sim:", 4)) {
        session->kind = DRIVE_SIMULATED;
        status = open_simulated(session, uri + 4);
    } else if (!strncmp(uri, "folder:", 7)) {
        session->kind = DRIVE_PLAYED;
        status = open_folder(session, uri + 7);
    } else if (!strncmp(uri, "ros:", 4)) {
        session->kind = DRIVE_ROS;
        status = open_ros(session, uri + 4);
    } else
        status = fail(ERR_INPUT, "'%s' is no robot; use ros:, folder:DIR or sim:", uri);
    seen_by(session)->processor_clock = how->processor_clock;
    if (status == OK && how->threads)
        status = surroundings_start_threads(seen_by(session));
    if (status != OK)
        drive_session_close(session);
    return status;
}

void drive_session_close(struct drive_session *session)
{
    simulated_rover_close(&session->rover);
    surroundings_close(&session->played);
    ros_rover_close(&session->ros);
    *session = (struct drive_session){0};
}

// What arrives at the robot by then.
static void receive_commands(struct drive_session *session, int64_t by_ns)
{
    while (session->pending_count && session->pending[0].arrives_ns <= by_ns) {
        session->command = session->pending[0].command;
        session->watch.heard = true;
        session->watch.heard_ns = session->pending[0].arrives_ns;
        memmove(session->pending, session->pending + 1, (size_t)--session->pending_count * sizeof *session->pending);
    }
}

static int64_t delay_ns(const struct drive_session *session) { return llround(session->options.link.delay_s * 1e9); }

static void send_command(struct drive_session *session, const struct drive_command *command)
{
    if (!drive_link_delivers(&session->options.link, session->sent++) || session->pending_count == DRIVE_PENDING)
        return;
    session->pending[session->pending_count].command = *command;
    session->pending[session->pending_count++].arrives_ns = session->now_ns + delay_ns(session);
}

// What the simulated robot does by itself from then until now, whether or not this program ran meanwhile: it carries
// out what arrives when it arrives, and stops when its watchdog has heard nothing for so long.
static enum status drive_robot(struct drive_session *session, int64_t from_ns)
{
    const int64_t max_ns = 50000000; // so that it is not driven through what it would touch
    enum status status = OK;
    while (status == OK && from_ns < session->now_ns) {
        bool lost;
        receive_commands(session, from_ns);
        const int64_t stops_ns = session->watch.heard_ns + llround(session->watch.patience_s * 1e9);
        const struct drive_command carried = link_watch_command(&session->watch, session->command, from_ns + 1, &lost);
        int64_t to_ns = session->now_ns;
        if (session->pending_count && session->pending[0].arrives_ns < to_ns)
            to_ns = session->pending[0].arrives_ns;
        if (!lost && stops_ns < to_ns)
            to_ns = stops_ns;
        if (!lost && to_ns - from_ns > max_ns)
            to_ns = from_ns + max_ns;
        status = simulated_rover_step(&session->rover, carried, (double)(to_ns - from_ns) * 1e-9);
        from_ns = to_ns;
    }
    return status;
}

static enum status step_session(struct drive_session *session, int64_t now_ns, const struct drive_command *command)
{
    const int64_t was_ns = session->now_ns;
    session->now_ns = now_ns;
    if (session->kind == DRIVE_ROS) {
        const enum status status = ros_rover_step(&session->ros, now_ns, command);
        session->link_lost = session->ros.lost;
        return status;
    }
    if (session->kind == DRIVE_PLAYED) { // it goes where it went, whatever it is told
        const struct surround_set *set = &session->played.set;
        const int64_t at = session->first_ns + now_ns - delay_ns(session);
        session->ended = at > set->odometry[set->odometry_count - 1].time_ns;
        session->link_lost = session->ended;
        return surroundings_advance(&session->played, at);
    }
    enum status status = drive_robot(session, was_ns);
    if (command)
        send_command(session, command);
    receive_commands(session, now_ns);
    const struct drive_command carried =
        link_watch_command(&session->watch, session->command, now_ns, &session->link_lost);
    return status == OK ? simulated_rover_step(&session->rover, carried, 0) : status;
}

enum status drive_session_step(struct drive_session *session, int64_t now_ns, const struct drive_command *command)
{
    const enum status status = step_session(session, now_ns, command);
    if (status == OK)
        drive_path_add(&session->path, drive_session_pose(session).translation);
    return status;
}

struct pose drive_session_pose(const struct drive_session *session)
{
    if (session->kind == DRIVE_SIMULATED)
        return simulated_rover_pose(&session->rover);
    if (session->kind == DRIVE_ROS)
        return ros_rover_pose(&session->ros);
    const struct surround_set *set = &session->played.set;
    const int64_t at = session->first_ns + session->now_ns - delay_ns(session);
    return surroundings_bridge(&session->played, pose_list_at(set->odometry, set->odometry_count, at));
}

// The command that moved the body over the last quarter of a second of a played folder.
static struct drive_command played_command(const struct drive_session *session)
{
    const struct surround_set *set = &session->played.set;
    const int64_t at = session->first_ns + session->now_ns - delay_ns(session);
    const struct pose before = pose_list_at(set->odometry, set->odometry_count, at - 250000000);
    const struct pose after = pose_list_at(set->odometry, set->odometry_count, at);
    const struct pose moved = pose_multiply(pose_inverse(before), after);
    return (struct drive_command){moved.translation.x / 0.25, quat_to_rotation_vector(moved.rotation).z / 0.25};
}

static double age_of_s(const struct drive_session *session, const struct surroundings *seen)
{
    if (session->kind == DRIVE_ROS)
        return ros_rover_age_s(&session->ros);
    const int64_t newest = seen->taken ? seen->pictures[seen->taken - 1].time_ns : session->first_ns;
    return (double)(session->now_ns + (session->kind == DRIVE_PLAYED ? session->first_ns : 0) - newest) * 1e-9;
}

static struct drive_command command_of(const struct drive_session *session)
{
    switch (session->kind) {
    case DRIVE_SIMULATED: return session->rover.command;
    case DRIVE_ROS: return session->ros.command;
    default: return played_command(session);
    }
}

struct drive_readings drive_session_readings(const struct drive_session *session)
{
    const struct surroundings *seen = drive_session_surroundings(session);
    const struct pose newest = seen->taken ? seen->poses[seen->taken - 1] : POSE_IDENTITY;
    return (struct drive_readings){
        .command = command_of(session),
        .age_s = age_of_s(session, seen),
        .link_lost = session->link_lost,
        .interrupted = session->kind == DRIVE_ROS && session->ros.interrupted,
        .near = session->near,
        .nearest_m = session->nearest_m,
        .picture_old = session->kind != DRIVE_PLAYED && seen->taken &&
                       (v3_distance(drive_session_pose(session).translation, newest.translation) > STALE_M ||
                        (session->kind == DRIVE_ROS && ros_rover_silent_s(&session->ros) > STALE_S)),
    };
}

const double *drive_session_size(const struct drive_session *session)
{
    switch (session->kind) {
    case DRIVE_SIMULATED: return session->rover.options.size_m;
    case DRIVE_ROS: return session->ros.rig.body_size_m;
    default: return session->played.set.body_size_m;
    }
}

struct pose drive_session_viewpoint(const struct drive_session *session)
{
    return operator_viewpoint(session->eye.viewpoint, POSE_IDENTITY, drive_session_size(session));
}

const struct lens *drive_session_lens(const struct drive_session *session)
{
    return &drive_session_surroundings(session)->view.lens;
}

static struct pose eye_of(const struct drive_session *session, struct pose body)
{
    if (session->eye.head)
        return pose_multiply(body, session->eye.body_from_eye);
    if (session->eye.orbit)
        return operator_orbit(body, session->eye.azimuth, session->eye.elevation, session->eye.distance_m);
    return operator_viewpoint(session->eye.viewpoint, body, drive_session_size(session));
}

static void fill_overlay(struct drive_session *session, struct pose body, struct operator_overlay *out)
{
    *out = (struct operator_overlay){.world_from_body = body,
                                     .command = command_of(session),
                                     .age_s = age_of_s(session, seen_by(session)),
                                     .link_lost = session->link_lost,
                                     .path = &session->path,
                                     .wordless = session->wordless};
    memcpy(out->size_m, drive_session_size(session), sizeof out->size_m);
    if (!session->eye.orbit && !session->eye.head &&
        session->eye.viewpoint == VIEWPOINT_FIRST) { // the eye is inside the body
        out->size_m[0] = out->size_m[1] = out->size_m[2] = 0;
        out->command = (struct drive_command){0, 0};
    }
}

enum status drive_session_prepare(struct drive_session *session, struct drive_scene *out)
{
    struct surroundings *seen = seen_by(session);
    const struct pose body = drive_session_pose(session);
    *out = (struct drive_scene){
        .world_from_view = eye_of(session, body), .lens = seen->view.lens, .options = seen->options.view};
    memcpy(out->size_m, drive_session_size(session), sizeof out->size_m);
    const enum status status = surroundings_prepare(seen, out->world_from_view, &out->pictures, &out->count);
    if (status == OK)
        fill_overlay(session, body, &out->overlay);
    return status;
}

enum status drive_session_draw(struct drive_session *session, const struct surround_view **view)
{
    struct surroundings *seen = seen_by(session);
    const struct pose body = drive_session_pose(session);
    const enum status status = surroundings_draw(seen, eye_of(session, body));
    if (status != OK)
        return status;
    struct operator_overlay overlay;
    struct nearest_thing thing = {0};
    fill_overlay(session, body, &overlay);
    session->near = nearest_in_view(&seen->view, body, drive_session_size(session), 0.1, &thing) == OK;
    session->nearest_m = thing.distance_m;
    operator_overlay_draw(&seen->view, &overlay, session->near ? &thing : NULL);
    *view = &seen->view;
    return OK;
}
