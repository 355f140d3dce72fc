// reenact: from a recording to the image.
#include "app/commands/commands.h"

int main(int argc, char **argv)
{
    static const struct command commands[] = {
        {"render", "draw a take into a camera's pictures", reenact_render},
        {"locate", "say where a camera was in the place", reenact_locate},
        {"compare", "say where two movements differ", reenact_compare},
        {"surround", "draw surroundings from a free viewpoint", reenact_surround},
        {"drive", "drive a robot by pictures of its surroundings", reenact_drive},
    };
    static const struct command watch = {"FILE", "watch, in a window", reenact_watch};
    return command_main(
        "reenact shows a recorded person again, from any side.\n\n  reenact FILE               watch, in a "
        "window; without FILE a start screen opens",
        commands, COUNT_OF(commands), &watch, argc, argv);
}
