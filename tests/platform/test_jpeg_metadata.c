// JPEG files without what they hold beside their picture. The segments are written here by the standard's tables.
#include "tests/support/test.h"

#include "platform/files/jpeg.h"
#include "tests/support/random.h"

#include <stdlib.h>
#include <string.h>

enum { W = 48, H = 40, MOST = 40000 };

struct bytes {
    uint8_t at[MOST];
    size_t count;
};

static void add(struct bytes *b, const void *data, size_t count)
{
    assert_true(b->count + count <= MOST);
    memcpy(b->at + b->count, data, count);
    b->count += count;
}

static void add_segment(struct bytes *b, uint8_t marker, const void *data, size_t count)
{
    const uint8_t head[4] = {0xff, marker, (uint8_t)((count + 2) >> 8), (uint8_t)((count + 2) & 0xff)};
    add(b, head, sizeof head);
    add(b, data, count);
}

// Exif of one entry, the orientation, and what a telephone adds: a place, a thumbnail.
static void add_exif(struct bytes *b, int orientation)
{
    struct bytes exif = {.count = 0};
    const uint8_t tiff[] = {'M', 'M', 0, 42, 0, 0, 0, 8, 0, 1, 1, 0x12, 0, 3, 0, 0, 0, 1, 0, (uint8_t)orientation,
                            0,   0,   0, 0,  0, 0};
    static const uint8_t thumbnail[] = {0xff, 0xd8, 0xff, 0xda, 0, 2, 'T', 'H', 'U', 'M', 'B', 0xff, 0xd9};
    add(&exif, "Exif\0", 6);
    add(&exif, tiff, sizeof tiff);
    add(&exif, "GPSLatitude 48.137", 18);
    add(&exif, thumbnail, sizeof thumbnail);
    add_segment(b, 0xe1, exif.at, exif.count);
}

static uint8_t rgb[W * H * 3];

static void encode(struct bytes *out)
{
    struct rng rng = {5};
    uint8_t *jpeg;
    size_t count;
    for (size_t i = 0; i < sizeof rgb; i++)
        rgb[i] = (uint8_t)(rng_uniform(&rng) * 256);
    EXPECT_STATUS(jpeg_encode(rgb, W, H, 90, &jpeg, &count), OK);
    out->count = 0;
    add(out, jpeg, count);
    free(jpeg);
}

static bool holds(const uint8_t *bytes, size_t count, const char *word)
{
    return memmem(bytes, count, word, strlen(word));
}

// The plain picture with everything that may stand beside it, before and after its JFIF segment.
static void dress(const struct bytes *plain, int orientation, struct bytes *out)
{
    static const uint8_t thumbnail[14 + 3] = {'J', 'F', 'I', 'F', 0, 1, 1, 0, 0, 1, 0, 1, 1, 1, 9, 9, 9};
    out->count = 0;
    add(out, plain->at, 2);
    EXPECT_INT(plain->at[3], 0xe0); // what libjpeg-turbo begins with
    const size_t rest = 4 + ((size_t)plain->at[4] << 8 | plain->at[5]);
    add_segment(out, 0xe0, thumbnail, sizeof thumbnail);
    add_segment(out, 0xe0, "JFXX\0\x10 a thumbnail", 19);
    add_exif(out, orientation);
    add_segment(out, 0xe1, "http://ns.adobe.com/xap/1.0/\0<x:creator>Ann</x>", 46);
    add_segment(out, 0xe2, "ICC_PROFILE\0\1\1profile", 21);
    add_segment(out, 0xe2, "MPF\0further pictures", 20);
    add_segment(out, 0xed, "Photoshop 3.0\0city", 18);
    add_segment(out, 0xfe, "a comment of Ann's", 18);
    add(out, plain->at + rest, plain->count - rest);
    add(out, "and a film after it, of Ann", 27);
}

static void test_only_the_picture_remains(void **state)
{
    (void)state;
    static const char *const gone[] = {"Exif", "GPS",       "THUMB",   "thumbnail", "Ann",
                                       "MPF",  "Photoshop", "comment", "JFXX"};
    static struct bytes plain, dressed;
    static uint8_t before[W * H * 3], after[W * H * 3];
    encode(&plain);
    EXPECT_STATUS(jpeg_decode(plain.at, plain.count, before, W, H), OK);
    for (int orientation = 1; orientation <= 8; orientation++) {
        uint8_t *out;
        size_t count;
        dress(&plain, orientation, &dressed);
        EXPECT_STATUS(jpeg_without_metadata(dressed.at, dressed.count, &out, &count), OK);
        for (size_t i = 0; i < COUNT_OF(gone); i++) {
            EXPECT_TRUE(holds(dressed.at, dressed.count, gone[i]));
            if (holds(out, count, gone[i]))
                print_error("'%s' is still there\n", gone[i]);
            EXPECT_TRUE(!holds(out, count, gone[i]));
        }
        EXPECT_TRUE(holds(out, count, "JFIF"));
        EXPECT_TRUE(memmem(out, count, "ICC_PROFILE\0\1\1profile", 21));
        // Coded pixels byte for byte: from the first table on, which follows the JFIF segment.
        const size_t tail = plain.count - 20;
        EXPECT_TRUE(count >= tail);
        assert_memory_equal(out + count - tail, plain.at + 20, tail);
        EXPECT_STATUS(jpeg_decode(out, count, after, W, H), OK);
        assert_memory_equal(before, after, sizeof before);
        free(out);
    }
}

static void test_a_plain_picture_stays_the_same(void **state)
{
    (void)state;
    static struct bytes plain;
    uint8_t *out;
    size_t count;
    encode(&plain);
    EXPECT_STATUS(jpeg_without_metadata(plain.at, plain.count, &out, &count), OK);
    EXPECT_INT(count, plain.count);
    assert_memory_equal(out, plain.at, count);
    free(out);
}

// Restart markers and stuffed bytes belong to the pixels; a further scan follows them.
static void test_scans_and_restarts(void **state)
{
    (void)state;
    static const uint8_t scan[] = {0xff, 0xda, 0, 3, 1, 7, 0xff, 0, 8, 0xff, 0xd3, 9},
                         both[] = {0xff, 0xd8, 0xff, 0xda, 0, 3, 1,    7, 0xff, 0,    8,    0xff, 0xd3, 9,
                                   0xff, 0xda, 0,    3,    1, 7, 0xff, 0, 8,    0xff, 0xd3, 9,    0xff, 0xd9};
    struct bytes b = {.count = 0};
    uint8_t *out;
    size_t count;
    add(&b, "\xff\xd8", 2);
    add(&b, scan, sizeof scan);
    add_segment(&b, 0xfe, "between", 7);
    add(&b, "\xff\xff", 2); // fill bytes
    add(&b, scan, sizeof scan);
    add(&b, "\xff\xd9", 2);
    EXPECT_STATUS(jpeg_without_metadata(b.at, b.count, &out, &count), OK);
    EXPECT_INT(count, sizeof both);
    assert_memory_equal(out, both, sizeof both);
    free(out);
}

// Wherever it is cut, and whatever byte is another: a result or a sentence, and never more than there was.
static void test_damaged_pictures(void **state)
{
    (void)state;
    static struct bytes plain, dressed;
    encode(&plain);
    dress(&plain, 6, &dressed);
    struct rng rng = {11};
    for (int i = 0; i < 2000; i++) {
        struct bytes b = dressed;
        uint8_t *out;
        size_t count;
        if (i % 2)
            b.count = (size_t)(rng_uniform(&rng) * (double)b.count);
        else
            b.at[(size_t)(rng_uniform(&rng) * 800)] = (uint8_t)(rng_uniform(&rng) * 256);
        const enum status status = jpeg_without_metadata(b.at, b.count, &out, &count);
        EXPECT_TRUE(status == OK || status == ERR_CORRUPT);
        EXPECT_TRUE(count <= b.count);
        EXPECT_TRUE((status == OK) == (out != NULL));
        free(out);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_only_the_picture_remains),
        cmocka_unit_test(test_a_plain_picture_stays_the_same),
        cmocka_unit_test(test_scans_and_restarts),
        cmocka_unit_test(test_damaged_pictures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
