// The place of a recording, as the input of a command.
#include "app/commands/place_input.h"

#include <stdlib.h>

// ---------------------------------------------------------------- filmed path

enum status filmed_path_open(struct filmed_path *filmed_path, const struct place *place, const char *path)
{
    *filmed_path = (struct filmed_path){.lens = place->calibration.color};
    struct lens *lens = &filmed_path->lens;
    lens->k1 = lens->k2 = lens->p1 = lens->p2 = lens->k3 = lens->readout_s = lens->focal_sigma = 0;
    enum status status = pose_list_read(path, &filmed_path->poses, &filmed_path->count);
    if (status == OK)
        status = filmed_room_open(&filmed_path->room, place, lens, NULL);
    if (status != OK)
        filmed_path_close(filmed_path);
    return status;
}

void filmed_path_close(struct filmed_path *path)
{
    surroundings_close(&path->room);
    free(path->poses);
    *path = (struct filmed_path){0};
}

enum status filmed_path_draw(struct filmed_path *path, int i)
{
    return surroundings_draw(&path->room, path->poses[i].pose);
}

// ---------------------------------------------------------------- place input

typedef enum status read_place(struct recording *, struct place *);

static enum status read_by(read_place *read, const char *path, struct place *out)
{
    struct recording *recording = NULL;
    enum status status = recording_open(&recording, path);
    if (status == OK)
        status = read(recording, out);
    recording_free(&recording);
    return status;
}

enum status place_input_read(const char *path, struct place *out) { return read_by(recording_read_place, path, out); }

enum status place_input_read_map(const char *path, struct place *out) { return read_by(recording_read_map, path, out); }
