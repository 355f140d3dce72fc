// A PNG picture that says how it is to be turned (its chunk eXIf, as cameras' software writes) is read as it is stored.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/image_file.h"
#include "platform/files/png.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <string.h>

enum { W = 32, H = 24 };

// CRC-32 of PNG's chunks (W3C PNG, annex D), bit by bit.
static uint32_t png_crc(const uint8_t *bytes, size_t count)
{
    uint32_t crc = 0xffffffff;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? 0xedb88320 ^ crc >> 1 : crc >> 1;
    }
    return ~crc;
}

// Depth and calibration lie on the pixels as they are stored: what a PNG says of its orientation is not obeyed, as a
// JPEG's is not.
static void test_a_png_that_is_to_be_turned(void **state)
{
    (void)state;
    static uint8_t rgb[W * H * 3];
    enum { HEAD = 8 + 25, TIFF = 26, CHUNK = 12 + TIFF }; // of the file: signature and IHDR; of the chunk
    uint8_t *bytes;
    size_t count;
    char path[300];
    struct scratch scratch = scratch_make();
    struct image plain, turned;
    for (size_t i = 0; i < sizeof rgb; i++)
        rgb[i] = (uint8_t)(i * 37);
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, "plain.png"));
    EXPECT_STATUS(png_write(path, PNG_RGB8, rgb, W, H), OK);
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    EXPECT_STATUS(image_decode(bytes, count, "plain", &plain), OK);
    for (uint8_t orientation = 1; orientation <= 8; orientation++) {
        // Big-endian TIFF with one entry: tag 0x112, one 16-bit number.
        const uint8_t chunk[CHUNK - 4] = {0, 0, 0, TIFF, 'e', 'X',  'I', 'f', 'M', 'M', 0, 42, 0, 0,
                                          0, 8, 0, 1,    1,   0x12, 0,   3,   0,   0,   0, 1,  0, orientation};
        const uint32_t crc = png_crc(chunk + 4, sizeof chunk - 4);
        uint8_t *with = malloc(count + CHUNK), *at = with + HEAD;
        memcpy(with, bytes, HEAD);
        memcpy(at, chunk, sizeof chunk);
        for (int k = 0; k < 4; k++)
            at[CHUNK - 4 + k] = (uint8_t)(crc >> (24 - 8 * k));
        memcpy(at + CHUNK, bytes + HEAD, count - HEAD);
        EXPECT_STATUS(image_decode(with, count + CHUNK, "turned", &turned), OK);
        EXPECT_INT(turned.width, plain.width);
        EXPECT_INT(turned.height, plain.height);
        EXPECT_TRUE(!memcmp(turned.rgb, plain.rgb, sizeof rgb));
        free(turned.rgb);
        free(with);
    }
    free(plain.rgb);
    free(bytes);
    scratch_remove(&scratch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_a_png_that_is_to_be_turned)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
