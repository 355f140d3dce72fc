// Depth sensors by their USB ids, in a folder that is laid out as the kernel's.
#include "tests/support/test.h"

#include "platform/sensors/usb_sensors.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

static struct scratch scratch;

static void plug(const char *port, const char *vendor, const char *product, int number)
{
    char path[100], text[16];
    const char *const files[][2] = {{"idVendor", vendor}, {"idProduct", product}};
    for (int i = 0; i < 2; i++) {
        snprintf(path, sizeof path, "devices/%s/%s", port, files[i][0]);
        scratch_text(&scratch, path, files[i][1]);
    }
    snprintf(path, sizeof path, "devices/%s/busnum", port);
    scratch_text(&scratch, path, "1\n");
    snprintf(path, sizeof path, "devices/%s/devnum", port);
    snprintf(text, sizeof text, "%d\n", number);
    scratch_text(&scratch, path, text);
    snprintf(path, sizeof path, "nodes/001/%03d", number);
    scratch_text(&scratch, path, "");
}

static struct usb_sensor *find(int *count)
{
    static struct usb_sensor found[8];
    char devices[300], nodes[300];
    snprintf(devices, sizeof devices, "%s", scratch_file(&scratch, "devices"));
    snprintf(nodes, sizeof nodes, "%s", scratch_file(&scratch, "nodes"));
    EXPECT_STATUS(usb_sensors_find(devices, nodes, found, COUNT_OF(found), count), OK);
    return found;
}

static void test_what_is_plugged_in(void **state)
{
    (void)state;
    int count;
    find(&count);
    EXPECT_INT(count, 0);                // no such folder
    plug("usb1", "1d6b\n", "0002\n", 1); // a hub of the kernel's own
    plug("1-2", "045e\n", "02d8\n", 2);  // Kinect v2
    plug("1-3", "045e\n", "00cb\n", 3);  // a mouse of the same maker
    plug("1-4", "8086\n", "0b3a\n", 4);  // RealSense
    plug("1-5", "1d27\n", "0609\n", 5);  // Xtion
    plug("1-6", "zzzz\n", "", 6);        // nothing that a kernel writes
    scratch_text(&scratch, "devices/1-2:1.0/bInterfaceClass", "0e\n");
    const struct usb_sensor *found = find(&count);
    EXPECT_INT(count, 3);
    EXPECT_TRUE(!strcmp(found[0].name, "Kinect for Xbox One (v2)") && strstr(found[0].needs, "libfreenect2"));
    EXPECT_TRUE(found[1].vendor == 0x1d27 && found[1].product == 0x0609 && !found[1].forbidden);
    EXPECT_TRUE(strstr(found[2].name, "D435i") && strstr(found[2].needs, "librealsense"));
}

static void test_a_device_that_may_not_be_opened(void **state)
{
    (void)state;
    int count;
    EXPECT_INT(chmod(scratch_file(&scratch, "nodes/001/005"), 0), 0);
    EXPECT_INT(chmod(scratch.path, 0755), 0);
    const bool root = !geteuid(); // who may open everything
    EXPECT_TRUE(!root || !seteuid(65534));
    const struct usb_sensor *found = find(&count);
    EXPECT_TRUE(!root || !seteuid(0));
    EXPECT_INT(count, 3);
    EXPECT_TRUE(found[1].forbidden && strstr(found[1].needs, "right to open"));
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
        cmocka_unit_test(test_what_is_plugged_in),
        cmocka_unit_test(test_a_device_that_may_not_be_opened),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
