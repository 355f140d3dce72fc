// What openni.c (opening) and openni_frames.c (reading) share; the only place
// that names OpenNI2's header. For these two files alone.
#pragma once
#include "platform/source_internal.h"

#include <pthread.h>
#include <stdatomic.h>

// OpenNI2's C header uses these as C++ would, without `struct`.
typedef struct _OniDevice _OniDevice;
typedef struct _OniStream _OniStream;
typedef struct _OniRecorder _OniRecorder;
#include <OniCAPI.h>

enum {
    LANE_QUEUE = 8,
    SLICE_MS = 50,          // how long to wait before looking whether the source is still there
    LIVE_SILENCE_MS = 5000, // a sensor silent for so long is gone
    FILE_SILENCE_MS = 3000, // a file's next picture takes milliseconds
};

// Keeps a file's player from running ahead: OpenNI2 holds only one picture per
// stream and overwrites it, so the next one's memory is handed out only when
// the last one has been taken.
struct gate {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    bool open; // closing down: nobody waits any more
};

struct lane { // one stream and the pictures that came from it, oldest first
    OniStreamHandle stream;
    OniVideoMode mode;
    bool mirrored; // by the source: to be turned back
    OniFrame *queue[LANE_QUEUE];
    int count;
    struct gate *gate;
    bool untaken; // guarded by the gate: a picture is with OpenNI2 and not yet in the queue
};

struct openni_sensor {
    char *name; // for sentences: "the sensor" and its name, or the file
    char uri[ONI_MAX_STR];
    bool file;
    bool initialized;
    OniDeviceHandle device;
    OniCallbackHandle callbacks;
    struct gate gate;
    struct lane depth, color; // color.stream is NULL where there is none
    bool got_frame;           // a picture has come
    atomic_bool gone, ended;  // set from OpenNI2's threads
    uint16_t *mm;
    uint8_t *rgb;
    int64_t half_frame_ns;
    int64_t handed_out, last_time_ns, last_index;
    struct source_facts *facts;
};

// ---- openni_frames.c
// The memory that OpenNI2 asks for a file's pictures; `cookie` is the lane.
void *gate_alloc(int size, void *cookie);
void gate_free(void *data, void *cookie);
void gate_open(struct gate *gate);

// Waits at most `wait_ms` for a picture and puts it into its queue. NOTHING: none came.
enum status openni_read_frame(struct openni_sensor *s, int wait_ms);

void lane_release_frames(struct lane *lane);

enum status openni_next(void *self, struct frame *out); // as source_next
