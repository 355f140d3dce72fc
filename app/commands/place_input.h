// The place of a recording, as the input of a command.
#pragma once
#include "recording/recording.h"
#include "surround/filmed/filmed_room.h"

// ---------------------------------------------------------------- filmed path

// A camera's way through a filmed place without a camera: poses from a file, and what each would see of the place,
// drawn from its recorded views (the ones that hold both colour and depth).

struct filmed_path {
    struct timed_pose *poses; // world_from_camera
    int count;
    struct lens lens; // the place's colour camera, without distortion
    struct surroundings room;
};

// `path`: lines of "seconds tx ty tz qx qy qz qw". ERR_INPUT: no pose, or the place has no colour camera; otherwise as
// pose_list_read. On failure *filmed_path is zeroed.
MUST_CHECK enum status filmed_path_open(struct filmed_path *filmed_path, const struct place *place, const char *path);
void filmed_path_close(struct filmed_path *path); // a zeroed one is fine

// The place from pose i: path->room.view.rgb. What was not filmed is hatched.
MUST_CHECK enum status filmed_path_draw(struct filmed_path *path, int i);

// ---------------------------------------------------------------- place input

// Reads the place of the file. NOTHING: it holds none. The caller owns *out: place_free. Errors as recording_open and
// recording_read_place.
MUST_CHECK enum status place_input_read(const char *path, struct place *out);
// The same without its views, as recording_read_map.
MUST_CHECK enum status place_input_read_map(const char *path, struct place *out);
