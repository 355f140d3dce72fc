// The place of a recording, as the input of a command.
#include "app/commands/place_input.h"

enum status place_input_read(const char *path, struct place *out)
{
    struct recording *recording = NULL;
    enum status status = recording_open(&recording, path);
    if (status == OK)
        status = recording_read_place(recording, out);
    recording_free(&recording);
    return status;
}
