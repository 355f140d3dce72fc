// Command line of film-world: what is rendered, from where and how.
#pragma once
#include "tests/world/world.h"

enum set { SET_PLACE = 1, SET_SENSOR = 2, SET_VIEWER = 4, SET_ALL = 7 };

struct film_options {
    const char *out;
    int sets;
    double seconds; // < 0: all
    int width, height;
    double focal_px;  // 0: as a Kinect's or a tablet's, by the width
    double rate_hz;   // 0: the reel's own
    double readout_s; // of a rolling shutter; the sensor on its stand has none
    bool clean;
    struct world_options world;
};

// One camera's film: its name, its rate, when its clock starts.
struct reel {
    const char *name;
    enum set set;
    double rate_hz, start_s;
    bool depth, actor;
};

enum { FILM_REELS = 3 };
extern const struct reel film_reels[FILM_REELS];

// Exits with status 2 and a message on wrong usage, and with 0 for --help and the like.
void film_read_options(int argc, char **argv, struct film_options *out);
