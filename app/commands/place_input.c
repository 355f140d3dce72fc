// The place of a recording, as the input of a command.
#include "app/commands/place_input.h"

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
