// reenact-capture calibrate: which of its kinds is meant.
#include "app/commands/commands.h"

int capture_calibrate(int argc, char **argv) { return capture_calibrate_stereo(argc, argv); }
