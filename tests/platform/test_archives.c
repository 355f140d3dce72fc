// ZIP archives and LZFSE data, as Record3D's files are made of: against what other programs packed.
#include "tests/support/test.h"

#include "platform/files/compress.h"
#include "platform/files/file.h"
#include "platform/files/lzfse.h"
#include "platform/files/zip_file.h"
#include "tests/support/scratch.h"
#include "tests/support/zip_writer.h"

#include <stdio.h>

static struct scratch scratch;

// ---------------------------------------------------------------- LZFSE

static size_t from_hex(const char *hex, uint8_t *out)
{
    size_t count = 0;
    for (unsigned byte; sscanf(hex + 2 * count, "%2x", &byte) == 1; count++)
        out[count] = (uint8_t)byte;
    return count;
}

// Packed by Apple's encoders; as published in the tests of other readers. crc: of the text, found with another decoder
// (that of dissect.util gives the same SHA-256).
static const struct {
    const char *packed, *text; // text: repeated; NULL: by its crc
    size_t count;
    uint32_t crc;
} vectors[] = {
    {"6276786e2c01000013000000c803616263f0fff005e163060000000000000062767824", "abc", 300, 0},
    {"6276786ea800000026000000e00568656c6c6f20636f6d7072657373656420584d54503815f077e25450060000000000000062767824",
     "hello compressed XMTP", 168, 0},
    {"6276783200100000040000000003007000000000000c0050830000002490000ce7d75c030000005c03000000c04ff0937c0f0000000000000"
     "0"
     "000000000000000000000000000000000000000000000000c0a30f00000000000000000000000000000000000000000000000000000000000"
     "0"
     "000000000000000000000000000000000000000000000000003456ff3f62767824",
     "A", 4096, 0},
    {"62767832df360000a401200e000d0030b92c8bef56220070a5000000398470085f00b0000000383e59c0f1090000005fc027710c0000fc031"
     "c"
     "1f03c7700cc70000000000000000006c00003600000000005f07000000e700000000100060418004120000e06338f9061e8067629dacdf013"
     "e"
     "836fe041f807be80fd14fc0e3fc29f70470000000000000000000000000000000000000000000000000000000000000000000000000010128"
     "8"
     "d24318d9f446277ac6885a4b5dea360854e4c4616262d667f9f1ff53187e598fe2f5ddf7b768f4bcc1f6441b9e55e0d1be84b4b91544337f1"
     "1"
     "c4d0d615068c79817f5d19f209c83975cf9669b7f3d1024d9cc795e8ac449090696a7660585fac1a891c40557bb46c1b62a35ab2608d574e8"
     "2"
     "ba9f3956d0f811370c78d69b24240ffd80ec4eccb6dc1e7f1c6f2f276a71e9c73183844c3dce83088eeed6c77c3e35316f414db430fcd2e22"
     "d"
     "0c07998d601addd5907f852df080386fe69eb78675198704b4bf5361caaf482e9333c6de0d46fbf87b4387fc6ac5711603000000000000000"
     "0"
     "0066b7fffffff3fffa3ff7ff1fd2273e1f85c5f04f0f4945ab8462767824",
     NULL, 0x36df, 0xdcc33f98},
};

static void test_lzfse_of_other_programs(void **state)
{
    (void)state;
    uint8_t packed[1000], *out = malloc(40000);
    for (size_t v = 0; v < COUNT_OF(vectors); v++) {
        const size_t count = from_hex(vectors[v].packed, packed), wanted = vectors[v].count;
        EXPECT_INT(lzfse_first_size(packed, count), wanted);
        EXPECT_STATUS(lzfse_decode(packed, count, out, wanted), OK);
        for (size_t i = 0; i < wanted && vectors[v].text; i++)
            EXPECT_INT(out[i], vectors[v].text[i % strlen(vectors[v].text)]);
        if (!vectors[v].text)
            EXPECT_INT(crc32_of(0, out, wanted), vectors[v].crc);
        EXPECT_STATUS(lzfse_decode(packed, count, out, wanted - 1), ERR_CORRUPT);
        EXPECT_STATUS(lzfse_decode(packed, count, out, wanted + 1), ERR_CORRUPT);
        EXPECT_SAYS("instead of");
        for (size_t cut = 0; cut < count; cut++) // cut short anywhere
            EXPECT_STATUS(lzfse_decode(packed, cut, out, wanted), ERR_CORRUPT);
    }
    // Several blocks of several kinds.
    size_t first = from_hex(vectors[3].packed, packed) - 4;
    memmove(packed + first, packed, first + 4);
    EXPECT_STATUS(lzfse_decode(packed, 2 * first + 4, out, 2 * vectors[3].count), OK);
    for (int half = 0; half < 2; half++)
        EXPECT_INT(crc32_of(0, out + (size_t)half * vectors[3].count, vectors[3].count), vectors[3].crc);
    first = from_hex(vectors[0].packed, packed) - 4;
    memcpy(packed + first, packed, first);
    EXPECT_STATUS(lzfse_decode(packed, 2 * first, out, 600), ERR_CORRUPT); // no end
    memcpy(packed + 2 * first, "bvx-\2\0\0\0xybvx$", 14);
    EXPECT_STATUS(lzfse_decode(packed, 2 * first + 14, out, 602), OK);
    EXPECT_TRUE(out[599] == 'c' && out[600] == 'x' && out[601] == 'y');
    free(out);
}

// ---------------------------------------------------------------- ZIP

static void test_members_of_an_archive(void **state)
{
    (void)state;
    struct zip_writer writer = {.count = 0};
    struct zip_file *zip;
    uint8_t *bytes;
    size_t count;
    char text[3000];
    for (size_t i = 0; i < sizeof text; i++)
        text[i] = (char)('a' + i * i % 7);
    zip_writer_add(&writer, "b/deflated", text, sizeof text, true);
    zip_writer_add(&writer, "a/stored", text, 100, false);
    zip_writer_add(&writer, "c/nothing", "", 0, true);
    zip_writer_end(&writer);
    const size_t data = strlen("b/deflated") + 30; // of the first member
    scratch_write(&scratch, "sound.zip", writer.bytes, writer.count);
    EXPECT_STATUS(zip_file_open(&zip, scratch_file(&scratch, "sound.zip")), OK);
    EXPECT_INT(zip_file_count(zip), 3);
    EXPECT_TRUE(!strcmp(zip_file_name(zip, 0), "a/stored") && zip_file_find(zip, "a") < 0);
    const size_t sizes[] = {100, sizeof text, 0};
    for (int i = 0; i < 3; i++) {
        EXPECT_STATUS(zip_file_read(zip, i, &bytes, &count), OK);
        EXPECT_INT(count, sizes[i]);
        assert_memory_equal(bytes, text, count);
        free(bytes);
    }
    zip_file_close(&zip);
    writer.bytes[data + 5] ^= 0x10;
    scratch_write(&scratch, "bad.zip", writer.bytes, writer.count);
    EXPECT_STATUS(zip_file_open(&zip, scratch_file(&scratch, "bad.zip")), OK);
    EXPECT_STATUS(zip_file_read(zip, 1, &bytes, &count), ERR_INPUT);
    EXPECT_SAYS("b/deflated in");
    EXPECT_SAYS("is damaged");
    EXPECT_STATUS(zip_file_read(zip, 0, &bytes, &count), OK);
    free(bytes);
    zip_file_close(&zip);
    // A member that claims to be huge, one that is encrypted, one that is packed by another method.
    static const struct {
        size_t from_list;
        uint8_t value;
        const char *says;
    } lies[] = {{27, 0x7f, "larger than anything"}, {8, 1, "is encrypted"}, {10, 99, "in a way that is not known"}};
    const size_t list = writer.count - 22 - writer.list_count;
    for (size_t i = 0; i < COUNT_OF(lies); i++) {
        const uint8_t before = writer.bytes[list + lies[i].from_list];
        writer.bytes[list + lies[i].from_list] = lies[i].value;
        scratch_write(&scratch, "lies.zip", writer.bytes, writer.count);
        writer.bytes[list + lies[i].from_list] = before;
        EXPECT_STATUS(zip_file_open(&zip, scratch_file(&scratch, "lies.zip")), OK);
        EXPECT_STATUS(zip_file_read(zip, 1, &bytes, &count), ERR_INPUT);
        EXPECT_SAYS(lies[i].says);
        zip_file_close(&zip);
    }
    for (size_t cut = 0; cut < writer.count; cut += 7) {
        scratch_write(&scratch, "cut.zip", writer.bytes, cut);
        EXPECT_STATUS(zip_file_open(&zip, scratch_file(&scratch, "cut.zip")), ERR_INPUT);
        EXPECT_TRUE(!zip);
    }
    zip_writer_free(&writer);
}

// A list that claims a gigabyte of a file that is as long (and takes no room on the disk).
static void test_a_huge_archive(void **state)
{
    (void)state;
    const long bytes = 1l << 30;
    const uint8_t begin[4] = {'P', 'K', 3, 4};
    uint8_t end[22] = {'P', 'K', 5, 6, 0, 0, 0, 0, 9, 0, 9, 0, 0, 0, 0, 0x3f};
    struct zip_file *zip;
    scratch_text(&scratch, "huge.zip", "");
    FILE *file = fopen(scratch_file(&scratch, "huge.zip"), "r+b");
    EXPECT_TRUE(file && fwrite(begin, 1, sizeof begin, file) == sizeof begin && !fseek(file, bytes, SEEK_SET) &&
                fwrite(end, 1, sizeof end, file) == sizeof end && !fclose(file));
    EXPECT_STATUS(zip_file_open(&zip, scratch_file(&scratch, "huge.zip")), ERR_INPUT);
    EXPECT_SAYS("lists more files than");
}

static int set_up(void **state)
{
    (void)state;
    scratch = scratch_make();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lzfse_of_other_programs),
        cmocka_unit_test(test_members_of_an_archive),
        cmocka_unit_test(test_a_huge_archive),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
