// MCAP, read back by tests/support/read_mcap, which checks lengths, checksums, indexes and statistics.
#include "tests/support/test.h"

#include "formats/mcap.h"
#include "tests/support/read_mcap.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct mcap_channel channels[] = {
    {"/a", "a.Schema", "{\"type\":\"object\"}"}, {"/b", "b.Schema", "{}"}, {"/silent", "c.Schema", "{}"}};

// Message i of a file: long ones, so that there are several chunks.
static size_t make_message(int i, char *out, size_t bytes)
{
    const size_t count = (size_t)i * 7919 % (bytes - 40) + 20;
    const int head = snprintf(out, bytes, "{\"i\":%d,\"filler\":\"", i);
    memset(out + head, 'a' + i % 26, count);
    memcpy(out + (size_t)head + count, "\"}", 3);
    return (size_t)head + count + 2;
}

static void check_file(int messages)
{
    static char text[60000];
    struct mcap_writer *w;
    struct read_mcap file;
    char *bytes;
    size_t count;
    FILE *out = open_memstream(&bytes, &count);
    EXPECT_STATUS(mcap_open(&w, out, channels, COUNT_OF(channels)), OK);
    for (int i = 0; i < messages; i++) {
        const size_t length = make_message(i, text, sizeof text);
        EXPECT_STATUS(mcap_add(w, i % 3 == 1, 5000000000 + i / 2 * 33333333LL, text, length), OK);
    }
    EXPECT_STATUS(mcap_close(&w, OK), OK);
    assert_null(w);
    assert_int_equal(fclose(out), 0);
    read_mcap((const uint8_t *)bytes, count, &file);
    print_message("%d messages, %d chunks, %zu bytes\n", file.count, file.chunks, count);
    EXPECT_INT(file.count, messages);
    EXPECT_INT(file.channels, COUNT_OF(channels));
    assert_string_equal(file.topic[1], "/b");
    assert_string_equal(file.schema_name[0], "a.Schema");
    assert_string_equal(file.schema[0], channels[0].schema);
    EXPECT_TRUE(messages < 300 || file.chunks > 3);
    for (int i = 0; i < file.count; i++) {
        EXPECT_INT(file.messages[i].count, make_message(i, text, sizeof text));
        assert_memory_equal(file.messages[i].data, text, file.messages[i].count);
        EXPECT_INT(file.messages[i].channel, i % 3 == 1);
        EXPECT_INT(file.messages[i].time_ns, 5000000000 + i / 2 * 33333333LL);
    }
    read_mcap_free(&file);
    free(bytes);
}

static void test_messages_come_back(void **state)
{
    (void)state;
    check_file(0);
    check_file(1);
    check_file(300);
}

// After an error nothing more is written: the caller throws the file away.
static void test_an_error_ends_it(void **state)
{
    (void)state;
    struct mcap_writer *w;
    char *bytes;
    size_t count;
    FILE *out = open_memstream(&bytes, &count);
    EXPECT_STATUS(mcap_open(&w, out, channels, 1), OK);
    EXPECT_STATUS(mcap_add(w, 0, 0, "{}", 2), OK);
    EXPECT_STATUS(mcap_close(&w, ERR_IO), ERR_IO);
    EXPECT_STATUS(mcap_close(&w, OK), OK); // there is none
    fclose(out);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_messages_come_back),
        cmocka_unit_test(test_an_error_ends_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
