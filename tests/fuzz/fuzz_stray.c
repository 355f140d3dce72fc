// Any bytes as a folder of Stray Scanner, read as a sensor: odometry.csv, a 0, camera_matrix.csv, a 0, rgb.mp4; where
// there is no second 0, a sound film. Without FFmpeg's libraries every folder is refused.
#include "platform/files/png.h"
#include "platform/files/video.h"
#include "tests/fuzz/fuzz_source.h"

#include <stdio.h>

static void make_film(void)
{
    static const uint8_t pixels[FUZZ_WIDTH * FUZZ_HEIGHT * 3];
    const struct video_layout layout = {FUZZ_WIDTH, FUZZ_HEIGHT, true};
    struct video_writer *writer;
    fuzz_file("stray/rgb.mp4", pixels, 0);
    FILE *file = fopen(fuzz_path("stray/rgb.mp4"), "w+b");
    FUZZ_CHECK(file != NULL);
    if (video_open(&writer, file, &layout) == OK) {
        for (int i = 0; i < 3; i++)
            FUZZ_CHECK(video_add(writer, pixels, i * 50000000ll) == OK);
        FUZZ_CHECK(video_close(&writer, OK) == OK);
    }
    fclose(file);
}

static void make_pictures(void)
{
    static bool made;
    static const uint16_t depth[FUZZ_WIDTH * FUZZ_HEIGHT] = {1000};
    static const uint8_t confidence[FUZZ_WIDTH * FUZZ_HEIGHT] = {2};
    if (made)
        return;
    made = true;
    mkdir(fuzz_path("stray"), 0777);
    mkdir(fuzz_path("stray/depth"), 0777);
    mkdir(fuzz_path("stray/confidence"), 0777);
    FUZZ_CHECK(png_write(fuzz_path("stray/depth/000000.png"), PNG_GRAY16, depth, FUZZ_WIDTH, FUZZ_HEIGHT) == OK);
    FUZZ_CHECK(png_write(fuzz_path("stray/depth/000001.png"), PNG_GRAY16, depth, FUZZ_WIDTH, FUZZ_HEIGHT) == OK);
    FUZZ_CHECK(png_write(fuzz_path("stray/confidence/000000.png"), PNG_GRAY8, confidence, FUZZ_WIDTH, FUZZ_HEIGHT) ==
               OK);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool sound;
    char uri[160];
    make_pictures();
    const uint8_t *part[3] = {data, NULL, NULL}, *const end = data + size;
    size_t count[3] = {size, 0, 0};
    for (int i = 1; i < 3 && part[i - 1]; i++) {
        const uint8_t *zero = count[i - 1] ? memchr(part[i - 1], 0, count[i - 1]) : NULL;
        if (!zero)
            break;
        count[i - 1] = (size_t)(zero - part[i - 1]);
        part[i] = zero + 1;
        count[i] = (size_t)(end - part[i]);
    }
    fuzz_file("stray/odometry.csv", part[0], count[0]);
    fuzz_file("stray/camera_matrix.csv", part[1] ? part[1] : data, count[1]);
    if (part[2])
        fuzz_file("stray/rgb.mp4", part[2], count[2]);
    else if (!sound)
        make_film();
    sound = !part[2];
    snprintf(uri, sizeof uri, "stray:%s", fuzz_path("stray"));
    fuzz_read_frames(uri, SOURCE_SENSOR, true);
    return 0;
}
