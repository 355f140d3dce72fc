// Between the program that reads an .oni file and the process that plays it.
//
// OpenNI2's file player follows what a file says without checks: a damaged or crafted one makes it read and write out
// of bounds, and a path with bytes above 127 likewise. So it runs in a process of its own, which may die. That process
// is this program once more, started through /proc/self/exe: a constructor sees by the name it was given that it is to
// play, and never gets to main. It gets the file, a socket and memory for the pictures as open descriptors.
//
// Each byte that comes over the socket asks for the next frame; the answer is a struct oni_reply, its pictures are in
// the shared memory: depth first (uint16_t, mm), then colour (RGB). The first answer, unasked, says how opening went.
// When the socket's other end closes, however its program ended, the player ends, in the middle of whatever it does.
#pragma once
#include "platform/sensors/source_internal.h"

// The player's descriptors.
enum { PLAYER_CHANNEL = 3, PLAYER_FILE, PLAYER_MEMORY, PLAYER_DESCRIPTORS };

extern const char oni_player_name[]; // argv[0] of the player; argv[1] is the file's name, for sentences

struct oni_reply {
    enum status status;
    char sentence[512]; // where it is an error
    struct calibration calibration;
    int64_t remaining, dropped, time_ns;
    char name[32];
    bool has_color;
};

// In openni.c: as a source_opener, of the file that is open as PLAYER_FILE, with the pictures in PLAYER_MEMORY, which
// gets its size here. openni_kind reads and closes it.
MUST_CHECK enum status oni_play(void **self, const char *name, struct source_facts *facts);
