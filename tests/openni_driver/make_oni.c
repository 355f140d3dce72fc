// make-oni --from FOLDER --out FILE.oni: converts a folder of images to a
// recording, with OpenNI2's own recorder and without loss. OpenNI2 reads the
// folder as a sensor (fake_sensor.cpp), so the file is like a real recording.
//
// That includes a fault of OpenNI2 2.2: its depth coder swaps the last two codes
// it writes when an image ends with an even number of equal values and one more,
// so that up to 31 pixels at the end of the bottom row may hold a neighbour's
// depth. Everything else equals the folder's, bit for bit.
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/sensors/source.h"
#include "tests/openni_driver/keep_player.h"

#include <argp.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct _OniDevice _OniDevice;
typedef struct _OniStream _OniStream;
typedef struct _OniRecorder _OniRecorder;
#include <OniCAPI.h>

struct options {
    const char *from, *out;
};

static error_t parse(int key, char *value, struct argp_state *state)
{
    struct options *options = state->input;
    if (key == 'f')
        options->from = value;
    else if (key == 'o')
        options->out = value;
    else if (key == ARGP_KEY_END && (!options->from || !options->out))
        argp_error(state, "--from and --out are needed");
    else
        return key == ARGP_KEY_END ? 0 : ARGP_ERR_UNKNOWN;
    return 0;
}

struct oni_recording {
    OniDeviceHandle device;
    OniStreamHandle streams[2]; // depth, colour; NULL where there is none
    OniRecorderHandle recorder;
};

static enum status oni_failed(const char *what)
{
    return fail(ERR_DEVICE, "OpenNI2 %s: %s", what, oniGetExtendedError());
}

static int64_t size_of(const char *path)
{
    struct stat about;
    return stat(path, &about) ? -1 : (int64_t)about.st_size;
}

// The recorder runs on its own thread and does not report when it is ready, except by what it has written. Waits until
// the file's size has not changed for 200 ms, at most 5 s.
static void wait_until_stable(const char *path)
{
    int64_t size = -1, until_ns = clock_now_ns() + 5000000000;
    for (int stable = 0; stable < 10 && clock_now_ns() < until_ns; stable++) {
        int64_t now = size_of(path);
        if (now != size || now <= 0)
            stable = 0;
        size = now;
        clock_sleep_until_ns(clock_now_ns() + 20000000);
    }
}

static enum status open_streams(struct oni_recording *r)
{
    static const OniSensorType types[] = {ONI_SENSOR_DEPTH, ONI_SENSOR_COLOR};
    OniBool off = FALSE; // a sensor that always mirrors is recorded mirrored
    if (oniDeviceOpen("reenact-fake-sensor/0", &r->device) != ONI_STATUS_OK)
        return oni_failed("does not find the fake sensor");
    for (int i = 0; i < 2; i++) {
        if (!oniDeviceGetSensorInfo(r->device, types[i]))
            continue;
        if (oniDeviceCreateStream(r->device, types[i], &r->streams[i]) != ONI_STATUS_OK)
            return oni_failed("makes no stream");
        oniStreamSetProperty(r->streams[i], ONI_STREAM_PROPERTY_MIRRORING, &off, sizeof off);
    }
    return OK;
}

// Records until `frames` depth images were sent.
static enum status record(struct oni_recording *r, const char *path, int frames)
{
    // By its descriptor: OpenNI2 crashes on a path with bytes above 127.
    char by_descriptor[64];
    const int file = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666); // open until the program ends
    snprintf(by_descriptor, sizeof by_descriptor, "/proc/self/fd/%d", file);
    if (file < 0 || oniCreateRecorder(by_descriptor, &r->recorder) != ONI_STATUS_OK)
        return fail(ERR_IO, "OpenNI2 cannot write %s", path);
    for (int i = 0; i < 2; i++)
        if (r->streams[i] && oniRecorderAttachStream(r->recorder, r->streams[i], FALSE) != ONI_STATUS_OK)
            return oni_failed("does not record a stream");
    if (oniRecorderStart(r->recorder) != ONI_STATUS_OK)
        return oni_failed("does not record");
    wait_until_stable(path);
    for (int i = 0; i < 2; i++)
        if (r->streams[i] && oniStreamStart(r->streams[i]) != ONI_STATUS_OK)
            return oni_failed("does not start a stream");
    // The recorder gets every image; only the number of the last one matters here.
    int64_t last_frame_ns = clock_now_ns();
    for (int last = 0; last < frames;) {
        int index;
        OniFrame *frame;
        if (oniWaitForAnyStream(r->streams, 1, &index, 100) == ONI_STATUS_OK &&
            oniStreamReadFrame(r->streams[0], &frame) == ONI_STATUS_OK && frame) {
            last = frame->frameIndex;
            oniFrameRelease(frame);
            last_frame_ns = clock_now_ns();
        } else if (clock_now_ns() - last_frame_ns > 10000000000) {
            return fail(ERR_DEVICE, "no picture came for 10 s, after %d of %d", last, frames);
        }
    }
    // The last colour image is sent after depth.
    clock_sleep_until_ns(clock_now_ns() + 200000000);
    return OK;
}

static void close_all(struct oni_recording *r)
{
    if (r->recorder)
        oniRecorderDestroy(&r->recorder); // flushes
    for (int i = 0; i < 2; i++)
        if (r->streams[i])
            oniStreamDestroy(r->streams[i]);
    if (r->device)
        oniDeviceClose(r->device);
    oniShutdown();
}

// Compares the number of frames that the recording states.
static enum status check(const char *path, int64_t frames)
{
    char uri[4096];
    struct source *s;
    snprintf(uri, sizeof uri, "oni:%s", path);
    enum status status = source_open(&s, uri, SOURCE_SENSOR);
    if (status != OK)
        return status;
    int64_t held = source_remaining(s);
    source_close(&s);
    return held == frames
               ? OK
               : fail(ERR_DEVICE, "%s holds %lld of %lld pictures", path, (long long)held, (long long)frames);
}

static enum status make(const struct options *options)
{
    char uri[4096];
    struct source *folder;
    snprintf(uri, sizeof uri, "folder:%s", options->from);
    enum status status = source_open(&folder, uri, SOURCE_SENSOR);
    if (status != OK)
        return status;
    int64_t frames = source_remaining(folder);
    source_close(&folder);
    char *from = realpath(options->from, NULL);
    setenv("REENACT_FAKE_SENSOR", from ? from : options->from, 1);
    setenv("REENACT_FAKE_SENSOR_FPS", "0", 1);
    setenv("REENACT_FAKE_SENSOR_AT_END", "stop", 1);
    free(from);
    struct oni_recording r = {0};
    if (oniInitialize(ONI_API_VERSION) != ONI_STATUS_OK)
        return oni_failed("does not start");
    status = open_streams(&r);
    if (status == OK)
        status = record(&r, options->out, (int)frames);
    close_all(&r);
    return status == OK ? check(options->out, frames) : status;
}

int main(int argc, char **argv)
{
    static const struct argp_option known[] = {
        {"from", 'f', "FOLDER", 0, "pictures in the TUM layout with a calibration.json", 0},
        {"out", 'o', "FILE.oni", 0, "the recording to make", 0},
        {0},
    };
    static const struct argp argp = {
        .options = known, .parser = parse, .doc = "Converts a folder of images to an OpenNI2 recording, without loss."};
    struct options options = {0};
    keep_player();
    argp_err_exit_status = 2;
    argp_parse(&argp, argc, argv, 0, NULL, &options);
    if (make(&options) != OK) {
        fprintf(stderr, "make-oni: %s\n", status_message());
        return 1;
    }
    return 0;
}
