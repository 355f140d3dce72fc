// reenact-capture: from a depth sensor to a recording.
#include "app/commands/commands.h"

int main(int argc, char **argv)
{
    static const struct command commands[] = {
        {"devices", "list the depth sensors that can be opened", capture_devices},
        {"tags", "make tags to print, and their list", capture_tags},
        {"map", "film the empty place", capture_map},
        {"record", "film the actor", capture_record},
        {"studio", "film in a window, with coaching", capture_studio},
        {"info", "say what a recording holds", capture_info},
        {"verify", "read every byte of a recording", capture_verify},
        {"repair", "save what can be read of a damaged recording", capture_repair},
        {"take", "rename, delete, trim or copy a take, or keep a note on it", capture_take},
        {"library", "list the takes of all recordings in a folder", capture_library},
        {"export", "write a take's joints for other programs", capture_export},
        {"angles", "say how far each joint goes in a take", capture_angles},
        {"calibrate", "a lens, colour to depth, a rolling shutter, two cameras", capture_calibrate},
        {"models", "networks that find body points in colour: whether they are there, and fetching them",
         capture_models},
        {"objects", "find known things before a stereo rig", capture_objects},
    };
    return command_main("reenact-capture films a person with one depth camera.", commands, COUNT_OF(commands), NULL,
                        argc, argv);
}
