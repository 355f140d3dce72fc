// What a knowledge base says of things: good and malicious JSON-LD; a server (nginx) that is good, slow, absent, wrong,
// huge, redirecting, or has a certificate that no authority signed. Without nginx that half is skipped.
#include "tests/support/test.h"

#include "base/clock.h"
#include "objects/thing_knowledge.h"
#include "platform/files/file.h"
#include "platform/network/http_client.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <arpa/inet.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

static const char url[] = "http://example.org/things/mug";

static enum status parse(const char *text, struct thing_knowledge *k)
{
    return thing_knowledge_parse(text, strlen(text), url, k);
}

static void test_a_product(void **state)
{
    (void)state;
    struct thing_knowledge k;
    EXPECT_STATUS(parse("{\"@context\":\"https://schema.org\",\"@type\":\"Product\",\"name\":\"Mug\","
                        "\"description\":\"Holds <b>tea</b>.\\nHot!\",\"weight\":{\"@type\":\"QuantitativeValue\","
                        "\"value\":0.35,\"unitCode\":\"KGM\"},\"material\":\"stoneware\",\"image\":\"mug.jpg\","
                        "\"instructions\":\"Lift by the handle.\",\"subjectOf\":{\"@type\":\"3DModel\",\"encoding\":"
                        "{\"contentUrl\":\"/models/mug.glb\"}}}",
                        &k),
                  OK);
    assert_string_equal(k.name, "Mug");
    assert_string_equal(k.description, "Holds tea . Hot!");
    assert_string_equal(k.weight, "0.35 kg");
    assert_string_equal(k.material, "stoneware");
    assert_string_equal(k.instructions, "Lift by the handle.");
    if (http_available()) {
        assert_string_equal(k.image, "http://example.org/things/mug.jpg");
        assert_string_equal(k.model, "http://example.org/models/mug.glb");
    }
}

static void test_forms_that_occur(void **state)
{
    (void)state;
    struct thing_knowledge k;
    EXPECT_STATUS(
        parse("{\"@graph\":[{\"@type\":\"WebPage\",\"name\":\"page\"},{\"@type\":[\"x\",\"http://schema.org/Thing\"],"
              "\"name\":{\"@value\":\"Can\",\"@language\":\"en\"},\"weight\":\"400 g\"}]}",
              &k),
        OK);
    assert_string_equal(k.name, "Can");
    assert_string_equal(k.weight, "400 g");
    EXPECT_STATUS(
        parse("[{\"@type\":\"Product\",\"name\":\"A\",\"weight\":{\"value\":\"12\",\"unitText\":\"kg\"}}]", &k), OK);
    assert_string_equal(k.weight, "12 kg");
}

static void test_malice(void **state)
{
    (void)state;
    struct thing_knowledge k;
    // addresses elsewhere, other schemes, models that are none
    EXPECT_STATUS(
        parse("{\"@type\":\"Thing\",\"name\":\"\\u202ea\\u0007b\\u200bc\",\"image\":\"http://evil.example/x.png\","
              "\"model\":\"file:///etc/passwd.glb\",\"weight\":{\"value\":1e400}}",
              &k),
        OK);
    assert_string_equal(k.name, "a b c");
    assert_string_equal(k.image, "");
    assert_string_equal(k.model, "");
    assert_string_equal(k.weight, "");
    EXPECT_STATUS(parse("{\"@type\":\"Thing\",\"name\":\"x\",\"model\":\"model.exe\"}", &k), OK);
    assert_string_equal(k.model, "");
    EXPECT_STATUS(parse("{\"@type\":\"Thing\"}", &k), ERR_INPUT);
    EXPECT_STATUS(parse("{\"@type\":\"Thing\",\"name\":\"\\u0001\"}", &k), ERR_INPUT);
    EXPECT_STATUS(parse("{\"@type\":\"Person\",\"name\":\"x\"}", &k), ERR_INPUT);
    EXPECT_STATUS(parse("{", &k), ERR_INPUT);
    EXPECT_STATUS(parse("", &k), ERR_INPUT);
    // deep nesting
    enum { DEEP = 100000 };
    char *deep = malloc(DEEP + 1);
    memset(deep, '[', DEEP);
    deep[DEEP] = 0;
    EXPECT_STATUS(parse(deep, &k), ERR_INPUT);
    free(deep);
    // a long name is cut at a whole character
    char text[1200] = "{\"@type\":\"Thing\",\"name\":\"";
    for (int i = 0; i < 200; i++)
        strcat(text, "\xc3\xa4");
    strcat(text, "\"}");
    EXPECT_STATUS(parse(text, &k), OK);
    EXPECT_INT(strlen(k.name), 126);
}

// Searching a list for each of its entries from the beginning would take minutes.
static void test_long_lists_are_not_searched_to_the_end(void **state)
{
    (void)state;
    enum { ENTRIES = 300000 };
    static const char *const begin[] = {"{\"name\":\"a\",\"@type\":[", "{\"@graph\":["},
                             *const end[] = {"\"Thing\"]}", "{\"@type\":\"Thing\",\"name\":\"a\"}]}"};
    struct thing_knowledge k;
    char *text = malloc(2 * ENTRIES + 200);
    for (int i = 0; i < 2; i++)
        for (int entries = 9; entries <= ENTRIES; entries += ENTRIES - 9) {
            char *at = text + sprintf(text, "%s", begin[i]);
            for (int n = 0; n < entries; n++)
                at += sprintf(at, "0,");
            strcpy(at, end[i]);
            EXPECT_STATUS(parse(text, &k), entries == 9 ? OK : ERR_INPUT);
        }
    free(text);
}

static void test_what_is_printed_is_read(void **state)
{
    (void)state;
    struct thing_knowledge k = {
        .name = "Box \"7\"", .description = "d", .material = "m", .instructions = "i", .weight = "2 kg"};
    struct thing_knowledge back;
    char *text = thing_knowledge_print(&k);
    EXPECT_TRUE(text != NULL);
    EXPECT_STATUS(parse(text, &back), OK);
    free(text);
    EXPECT_INT(memcmp(&k, &back, sizeof k), 0);
}

// ---- with a server

struct server {
    struct scratch scratch;
    int port, other, tls; // tls 0: none
    pid_t pid;
    char base[64], secure[64];
};

static int free_port(void)
{
    const int s = socket(AF_INET, SOCK_STREAM, 0);
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof a;
    assert_true(!bind(s, (struct sockaddr *)&a, sizeof a) && !getsockname(s, (struct sockaddr *)&a, &size));
    close(s);
    return ntohs(a.sin_port);
}

static bool answers(int port)
{
    const int s = socket(AF_INET, SOCK_STREAM, 0);
    const struct sockaddr_in a = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const bool good = !connect(s, (const struct sockaddr *)&a, sizeof a);
    close(s);
    return good;
}

static void replace(char *text, size_t bytes, const char *mark, const char *with)
{
    char out[8192];
    for (char *at; (at = strstr(text, mark));) {
        snprintf(out, sizeof out, "%.*s%s%s", (int)(at - text), text, with, at + strlen(mark));
        snprintf(text, bytes, "%s", out);
    }
}

static void write_pages(const struct scratch *s)
{
    static const char mug[] = "{\"@context\":\"https://schema.org\",\"@type\":\"Product\",\"name\":\"Mug\"}";
    assert_int_equal(folder_make(scratch_file(s, "www/things")), OK);
    scratch_text(s, "www/things/mug", mug);
    scratch_text(s, "www/slow", mug);
    scratch_text(s, "www/closed", mug);
    scratch_text(s, "users", "me:{PLAIN}p@5ecret\n");
    char *huge = malloc(8 << 20);
    memset(huge, ' ', 8 << 20);
    scratch_write(s, "www/huge", huge, 8 << 20);
    free(huge);
}

static bool make_certificate(const struct scratch *s)
{
    char key[256], certificate[256];
    if (!file_exists("/usr/bin/openssl"))
        return false;
    snprintf(key, sizeof key, "%s", scratch_file(s, "key.pem"));
    snprintf(certificate, sizeof certificate, "%s", scratch_file(s, "certificate.pem"));
    struct process_result r =
        PROCESS("/usr/bin/openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", key, "-out",
                certificate, "-days", "2", "-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1");
    return r.exit_code == 0;
}

static void start(struct server *s)
{
    uint8_t *text;
    size_t count;
    char config[8192], number[16], tls[1024] = "";
    s->scratch = scratch_make();
    s->port = free_port();
    s->other = free_port();
    write_pages(&s->scratch);
    if (make_certificate(&s->scratch)) {
        s->tls = free_port();
        snprintf(
            tls, sizeof tls,
            "server { listen 127.0.0.1:%d ssl; ssl_certificate @ROOT@/certificate.pem; ssl_certificate_key "
            "@ROOT@/key.pem; root @ROOT@/www; location = /down { return 302 http://127.0.0.1:@PORT@/things/mug; } }",
            s->tls);
    }
    assert_int_equal(file_read(SOURCE_DIR "/tests/knowledge/nginx.conf.in", &text, &count), OK);
    snprintf(config, sizeof config, "%s", (char *)text);
    free(text);
    snprintf(number, sizeof number, "%d", s->other);
    replace(config, sizeof config, "@OTHER@", number);
    snprintf(number, sizeof number, "%d", s->port);
    replace(config, sizeof config, "@TLS_SERVER@", tls);
    replace(config, sizeof config, "@ROOT@", s->scratch.path);
    replace(config, sizeof config, "@PORT@", number);
    replace(config, sizeof config, "@TLS@", "");
    scratch_text(&s->scratch, "nginx.conf", config);
    s->pid =
        process_start((const char *const[]){"/usr/sbin/nginx", "-c", scratch_file(&s->scratch, "nginx.conf"), NULL});
    for (int i = 0; i < 200 && !answers(s->port); i++)
        usleep(50000);
    assert_true(answers(s->port));
    snprintf(s->base, sizeof s->base, "http://127.0.0.1:%d/", s->port);
    snprintf(s->secure, sizeof s->secure, "https://127.0.0.1:%d/", s->tls);
}

static void stop(struct server *s)
{
    kill(s->pid, SIGTERM);
    waitpid(s->pid, NULL, 0);
    scratch_remove(&s->scratch);
}

static void expect_kept(const struct server *s, const char *page, enum status wanted, const char *word, struct known *k)
{
    struct http_limits limits = http_default_limits();
    limits.total_ms = 1500;
    EXPECT_STATUS(thing_knowledge_fetch(s->base, page, &limits, k), wanted);
    if (!strstr(k->trouble, word))
        print_error("%s: '%s' does not say '%s'\n", page, k->trouble, word);
    EXPECT_TRUE(strstr(k->trouble, word) != NULL);
    assert_string_equal(k->knowledge.name, "Mug"); // nothing was lost
}

// A password in the address opens the server and is nowhere afterwards.
static void test_passwords_are_not_kept(void **state)
{
    (void)state;
    struct server s = {0};
    struct known k = {0};
    struct http_limits limits = http_default_limits();
    char base[128], other[128];
    if (!file_exists("/usr/sbin/nginx") || !http_available())
        skip_without("nginx and libcurl");
    start(&s);
    snprintf(base, sizeof base, "http://me:p%%405ecret@127.0.0.1:%d/", s.port);
    snprintf(other, sizeof other, "http://me:p%%405ecret@127.0.0.1:%d/", s.other);
    EXPECT_STATUS(thing_knowledge_fetch(base, "closed", &limits, &k), ERR_IO); // it went with the base's address
    EXPECT_TRUE(strstr(k.trouble, "name and password") && !strstr(k.trouble, "5ecret"));
    limits.login = other; // another server's is not told
    EXPECT_STATUS(thing_knowledge_fetch(base, "closed", &limits, &k), ERR_IO);
    limits.login = base;
    EXPECT_STATUS(thing_knowledge_fetch(base, "closed", &limits, &k), OK);
    print_message("%s\n", k.url);
    EXPECT_TRUE(strstr(k.url, "http://127.0.0.1") && !strstr(k.url, "me:"));
    static const char *const pages[] = {"nothing-here?key=hidden", "error", "wrong", "empty", "huge", "circle"};
    for (size_t i = 0; i < COUNT_OF(pages); i++) {
        EXPECT_TRUE(thing_knowledge_fetch(base, pages[i], &limits, &k) < OK);
        if (strstr(k.trouble, "5ecret") || strstr(k.trouble, "hidden") || !strstr(k.trouble, "127.0.0.1"))
            print_error("%s\n", k.trouble);
        EXPECT_TRUE(!strstr(k.trouble, "5ecret") && !strstr(k.trouble, "hidden") && strstr(k.trouble, "127.0.0.1"));
    }
    stop(&s);
    EXPECT_STATUS(thing_knowledge_fetch(base, "closed", &limits, &k), ERR_IO);
    EXPECT_TRUE(strstr(k.trouble, "127.0.0.1") && !strstr(k.trouble, "5ecret"));
    free(k.text);
}

static void test_addresses_as_they_are_shown(void **state)
{
    (void)state;
    static const struct {
        const char *address, *kept, *shown;
    } cases[] = {
        {"http://host/a", "http://host/a", "http://host/a"},
        {"http://u:s@host:8/a@b?k=v#f", "http://host:8/a@b?k=v#f", "http://host:8/a@b?…"},
        {"https://u:s@t@host", "https://host", "https://host"},
        {"http:/u:s@host/x", "http:/host/x", "http:/host/x"},
        {"//u:s@host/x", "//host/x", "//host/x"},
        {"things//a@b", "things//a@b", "things//a@b"},
        {"mug", "mug", "mug"},
        {"mailto:u@host", "mailto:u@host", "mailto:u@host"},
        {"", "", ""},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        char kept[256], shown[ADDRESS_SHOWN_BYTES];
        snprintf(kept, sizeof kept, "%s", cases[i].address);
        address_hide_user(kept);
        assert_string_equal(kept, cases[i].kept);
        assert_string_equal(address_shown(cases[i].address, shown), cases[i].shown);
    }
    char address[2000] = "http://u:", shown[ADDRESS_SHOWN_BYTES]; // an @ beyond what is shown
    memset(address + 9, 's', 1000);
    strcpy(address + 1009, "@host/");
    assert_string_equal(address_shown(address, shown), "http://host/");
}

static void test_a_server_good_and_bad(void **state)
{
    (void)state;
    struct server s = {0};
    struct known k = {0};
    const struct http_limits limits = http_default_limits();
    if (!file_exists("/usr/sbin/nginx") || !http_available())
        skip_without("nginx and libcurl");
    start(&s);
    EXPECT_STATUS(thing_knowledge_fetch(s.base, "things/mug", &limits, &k), OK);
    assert_string_equal(k.knowledge.name, "Mug");
    EXPECT_TRUE(k.etag[0] != 0);
    EXPECT_STATUS(thing_knowledge_fetch(s.base, "things/mug", &limits, &k), NOTHING); // by its ETag
    EXPECT_STATUS(thing_knowledge_fetch(s.base, "moved", &limits, &k), OK);
    expect_kept(&s, "nothing-here", ERR_MISSING, "nothing there", &k);
    expect_kept(&s, "error", ERR_IO, "503", &k);
    expect_kept(&s, "wrong", ERR_INPUT, "not valid JSON", &k);
    expect_kept(&s, "empty", ERR_INPUT, "empty", &k);
    expect_kept(&s, "huge", ERR_INPUT, "larger than", &k);
    expect_kept(&s, "elsewhere", ERR_INPUT, "another server", &k);
    expect_kept(&s, "port", ERR_INPUT, "another server", &k);
    expect_kept(&s, "secret", ERR_INPUT, "another server", &k);
    EXPECT_TRUE(!strstr(k.trouble, "hidden"));
    expect_kept(&s, "circle", ERR_INPUT, "redirects more than", &k);
    expect_kept(&s, "file", ERR_INPUT, "another server", &k);
    expect_kept(&s, "http://evil.example/x", ERR_INPUT, "not on the server", &k);
    expect_kept(&s, "file:///etc/passwd", ERR_INPUT, "not on the server", &k);
    const int64_t begin = clock_now_ns();
    expect_kept(&s, "slow", ERR_IO, "in time", &k);
    EXPECT_AT_MOST(1e-9 * (double)(clock_now_ns() - begin), 10 * PROCESS_PATIENCE);
    if (s.tls) {
        struct http_limits trusting = limits;
        char file[256];
        snprintf(file, sizeof file, "%s", scratch_file(&s.scratch, "certificate.pem"));
        EXPECT_STATUS(thing_knowledge_fetch(s.secure, "things/mug", &limits, &k), ERR_IO);
        EXPECT_TRUE(strstr(k.trouble, "certificate") != NULL);
        trusting.authorities = file;
        EXPECT_STATUS(thing_knowledge_fetch(s.secure, "things/mug", &trusting, &k), OK);
        EXPECT_STATUS(thing_knowledge_fetch(s.secure, "down", &trusting, &k), ERR_INPUT); // not from https to http
    }
    stop(&s);
    expect_kept(&s, "things/mug", ERR_IO, "nothing answers", &k); // absent
    free(k.text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_product),
        cmocka_unit_test(test_forms_that_occur),
        cmocka_unit_test(test_malice),
        cmocka_unit_test(test_long_lists_are_not_searched_to_the_end),
        cmocka_unit_test(test_what_is_printed_is_read),
        cmocka_unit_test(test_addresses_as_they_are_shown),
        cmocka_unit_test(test_passwords_are_not_kept),
        cmocka_unit_test(test_a_server_good_and_bad),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
