// Shared by openni.c (opening) and openni_frames.c (reading) only; the only
// place that includes OpenNI2's header.
#pragma once
#include "platform/sensors/source_internal.h"

#include <pthread.h>
#include <stdatomic.h>

// OpenNI2's C header uses these without `struct`.
typedef struct _OniDevice _OniDevice;
typedef struct _OniStream _OniStream;
typedef struct _OniRecorder _OniRecorder;
#include <OniCAPI.h>

enum {
    STREAM_QUEUE = 8,
    SLICE_MS = 50,          // one wait for a frame, before checking whether the source still exists
    LIVE_SILENCE_MS = 5000, // a sensor without frames for this long has failed
    FILE_SILENCE_MS = 3000, // a file without frames for this long has ended; its next frame takes milliseconds
};

// Keeps OpenNI2's file player from running ahead: OpenNI2 holds only one image
// per stream and overwrites it, so memory for the next one is returned only
// after the last one was read.
struct gate {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    bool open; // closing: waits end
};

struct image_stream { // one stream and the images read from it, oldest first
    OniStreamHandle handle;
    OniVideoMode mode;
    bool mirrored; // by the source: copying mirrors it back
    OniFrame *queue[STREAM_QUEUE];
    int count;
    struct gate *gate;
    bool untaken; // guarded by gate.lock: OpenNI2 holds an image that is not yet in the queue
};

struct openni_sensor {
    char *name; // for error sentences: "the sensor" and its name, or the file
    char uri[ONI_MAX_STR];
    bool file;
    bool initialized;
    OniDeviceHandle device;
    OniCallbackHandle callbacks;
    struct gate gate;
    struct image_stream depth, color; // color.handle is NULL where there is none
    bool got_frame;                   // an image was received
    atomic_bool gone, ended;          // set from OpenNI2's threads
    void *pictures;                   // holds the next two
    size_t pictures_bytes;
    uint16_t *mm;
    uint8_t *rgb;
    int64_t half_frame_ns;
    int64_t handed_out, last_time_ns, last_index;
    struct source_facts *facts;
};

// ---- openni_frames.c
// Allocators of a file's images for OpenNI2; `cookie` is the stream.
void *gate_alloc(int size, void *cookie);
void gate_free(void *data, void *cookie);
void gate_open(struct gate *gate);

// Waits at most `wait_ms` for an image and appends it to its queue. NOTHING: none came.
enum status openni_read_frame(struct openni_sensor *s, int wait_ms);

void image_stream_release_frames(struct image_stream *stream);

enum status openni_next(void *self, struct frame *out); // as source_next
