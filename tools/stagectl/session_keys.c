/* session_keys.c - the table of session keys and the reading and writing of single values. */
#include "session_internal.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"

#define AT(m) offsetof(session, m)
static const double huge = 1e300;

/* clang-format off */
const session_key session_keys[] = {
    {"grid", "nodes", KEY_SIZE, AT(nodes), 1, 100000, NULL, 1, "NxM: grid nodes along U and V"},
    {"grid", "plane", KEY_NUMBERS9, AT(plane), -1e300, 1e300, NULL, 1, "Ox Oy Oz Ux Uy Uz Vx Vy Vz: corner and edges of the sampled rectangle, scene units"},
    {"grid", "order", KEY_ORDER, AT(order), 0, 0, "serpentine", 1, "serpentine (each second row backwards) or raster"},
    {"grid", "positions", KEY_TEXT, AT(positions), 0, 0, "all", 0, "nodes to visit: all, a file with a line 'I J' for each, or adaptive: a coarse grid, then where what hides the lamps is least certain"},
    {"grid", "positions_most", KEY_WHOLE, AT(positions_most), 0, 1e6, "0", 0, "adaptive: at most so many nodes; 0 = 5/8 of them"},
    {"grid", "positions_error", KEY_NUMBER, AT(positions_error), 0, 1, "0.005", 0, "adaptive: enough when light from above is uncertain by this share"},
    {"stage", "driver", KEY_TEXT, AT(driver), 0, 0, "grbl", 1, "grbl or c4"},
    {"stage", "port", KEY_TEXT, AT(port), 0, 0, "", 0, "serial port; --port on the command line wins"},
    {"stage", "unit_mm", KEY_NUMBER, AT(unit_mm), 1e-9, 1e9, "1", 1, "mm per scene unit (1000 when the scene is in metres)"},
    {"stage", "origin", KEY_NUMBERS2, AT(origin), -1e6, 1e6, "0 0", 1, "machine position of the plane's corner O, mm"},
    {"stage", "axes", KEY_AXES, AT(axes), 0, 0, "x y", 1, "machine axes along U and V: x y, y x, with - for a reversed one (-x y)"},
    {"stage", "feed", KEY_NUMBER, AT(feed), 1e-3, 1e6, "1500", 0, "speed of moves, mm/min"},
    {"stage", "settle", KEY_NUMBER, AT(settle), 0, 3600, "0.5", 0, "rest after each move before the first exposure, s"},
    {"stage", "backlash", KEY_NUMBERS2, AT(backlash), -1000, 1000, "0.5 0.5", 1, "each axis comes to its target from this far on one side, mm; the sign is the direction of approach; 0 = none"},
    {"stage", "home", KEY_YES_NO, AT(home), 0, 0, "yes", 1, "home before the first move; no = the stage's zero is taken as it is"},
    {"stage", "travel", KEY_NUMBERS4, AT(travel), -1e6, 1e6, "0 0 0 0", 0, "x lowest, x highest, y lowest, y highest machine position, mm; 0 0 0 0 = as the controller says"},
    {"stage", "steps_per_mm", KEY_NUMBERS2, AT(steps_per_mm), 0, 1e6, "0 0", 1, "steps per mm of x and y where the controller can't say (c4); 0 0 = as the controller says"},
    {"stage", "home_timeout", KEY_NUMBER, AT(home_timeout), 0, 36000, "0", 0, "longest time that homing may take, s; 0 = what the controller's settings say that it can take"},
    {"stage", "homing", KEY_TEXT, AT(homing), 0, 0, "$H", 0, "commands that home it, for firmware that homes single axes: $HX $HY"},
    {"stage", "check_home", KEY_WHOLE, AT(check_home), 0, 1e6, "0", 0, "every so many places look where the homing switches are, home, and say what has drifted; 0 = never"},
    {"stage", "baud", KEY_WHOLE, AT(baud), 0, 4e6, "0", 0, "speed of the serial line; 0 = the driver's"},
    {"stage", "dtr", KEY_ON_OFF, AT(dtr), 0, 0, "on", 0, "off: drop DTR and RTS once the port is open, for boards that these lines hold in reset"},
    {"stage", "acceleration", KEY_NUMBER, AT(acceleration), 0, 1e6, "0", 0, "for the plan's times, mm/s2; 0 = as the controller says"},
    {"camera", "command", KEY_TEXT, AT(command), 0, 0, NULL, 1, "run for each exposure; {file} {stem} {seconds} {label} {i} {j} {k} {x} {y} {ax} {ay} {mx} {my} {plane} {lens} {fov}"},
    {"camera", "depends", KEY_TEXT, AT(depends), 0, 0, "auto", 0, "files that decide what it sees, relative to the session file: when one changes, the capture is refused; auto = octree, falloff and response of a virtualcamera; none"},
    {"camera", "lens", KEY_TEXT, AT(lens), 0, 0, "", 2, "{lens} here and in [chain]; empty = the virtualcamera's, equidistant"},
    {"camera", "fov", KEY_NUMBER, AT(fov), 0, 360, "0", 2, "{fov} here and in [chain], degrees; 0 = the virtualcamera's, 185"},
    {"camera", "labels", KEY_TEXT, AT(labels), 0, 0, "", 1, "a word for each exposure, {label} in the command: what the camera calls it"},
    {"camera", "error_text", KEY_TEXT, AT(error_text), 0, 0, "auto", 0, "texts, parted by |, that mean failure when the command prints one, whatever its exit code; auto = *** Error for gphoto2; empty = none"},
    {"camera", "expect_text", KEY_TEXT, AT(expect_text), 0, 0, "", 0, "text that the command has to print, with {label} and the like; empty = none"},
    {"camera", "times", KEY_TIMES, AT(list_times), 0, 0, "asked", 1, "times in hdrgen's list: asked (a picture that says another is refused) or exif (as each picture says)"},
    {"camera", "time_tolerance", KEY_NUMBER, AT(time_tolerance), 0, 100, "0.12", 0, "share by which the time that a picture says may be off what was asked (1/60 means 1/64)"},
    {"camera", "f_number", KEY_NUMBER, AT(f_number), -1, 1000, "0", 0, "that pictures have to say; 0 = the one of the session's first, -1 = not looked at"},
    {"camera", "iso", KEY_NUMBER, AT(iso), -1, 1e8, "0", 0, "likewise"},
    {"camera", "shell", KEY_YES_NO, AT(shell), 0, 0, "no", 1, "give the command to sh -c instead of running its words"},
    {"camera", "timeout", KEY_NUMBER, AT(timeout), 0, 86400, "0", 0, "longest time beyond the exposure itself, s; 0 = 30, or 3600 for a virtualcamera, which renders a place at its first exposure"},
    {"camera", "kill_after", KEY_NUMBER, AT(kill_after), 0, 3600, "5", 0, "from asking an overdue camera to end (TERM) to ending it (KILL), s"},
    {"camera", "retries", KEY_WHOLE, AT(retries), 0, 100, "2", 0, "times that a failed exposure is tried again"},
    {"camera", "retry_wait", KEY_NUMBER, AT(retry_wait), 0, 3600, "1", 0, "rest before each of them, s"},
    {"camera", "on_fail", KEY_ON_FAIL, AT(on_fail), 0, 0, "stop", 0, "when they are used up: stop, or skip (go on with the next place, and take what is missing at the end)"},
    {"camera", "exposures", KEY_EXPOSURES, AT(exposures_text), 0, 0, "from 1/16384 to 2 step 1", 1, "seconds, rising, or 'from A to B step S' in stops"},
    {"camera", "auto", KEY_YES_NO, AT(adaptive), 0, 0, "no", 1, "take only the exposures that a place needs"},
    {"camera", "clip_share", KEY_NUMBER, AT(clip_share), 0, 1, "0", 1, "auto: share of the pixels that may clip in the shortest exposure"},
    {"camera", "black_share", KEY_NUMBER, AT(black_share), 0, 1, "0.001", 1, "auto: share of the pixels that may be black in the longest exposure"},
    {"camera", "clip_level", KEY_NUMBER, AT(clip_level), 0.01, 1, "0.99", 1, "auto: a pixel clips at this share of the highest code"},
    {"camera", "black_level", KEY_NUMBER, AT(black_level), 0, 0.99, "0.02", 1, "auto: a pixel is black up to this share of the highest code"},
    {"camera", "circle", KEY_NUMBER, AT(circle), 0, 10, "0.97", 1, "radius of the image circle over half the shorter side: what lies outside does not count for auto, nor for hdrgen's counts; 0 = whole picture"},
    {"camera", "check", KEY_CHECK, AT(check), 0, 0, "decode", 0, "what makes a file good: decode (all of it can be read) or size (not empty)"},
    {"camera", "check_picture", KEY_WHOLE, AT(check_picture), 0, 1e6, "0", 0, "after each so many places, at the end and on going on: the first place's picture twice more, compared with the one on record; 0 = never"},
    {"camera", "check_difference", KEY_NUMBER, AT(check_difference), 0, 1, "0.02", 0, "share of its contrast by which it may differ (and twice what two in a row do)"},
    {"camera", "overhead", KEY_NUMBER, AT(overhead), 0, 3600, "0", 0, "for the plan's times: s per exposure besides the exposure"},
    {"camera", "file_mb", KEY_NUMBER, AT(file_mb), 0, 1e5, "1", 0, "for the plan's space: size of a file in MB"},
    {"output", "folder", KEY_TEXT, AT(folder), 0, 0, NULL, 0, "where journal and pictures go, relative to the session file"},
    {"output", "file", KEY_TEXT, AT(file), 0, 0, "{i:03}_{j:03}/{k:02}.png", 1, "name of a picture in the folder; the ending is the camera's format"},
    {"output", "times", KEY_TEXT, AT(times), 0, 0, "{i:03}_{j:03}/times.txt", 1, "list of a place's pictures and times for hdrgen, written when the place is done; empty = none"},
    {"output", "repeat_points", KEY_YES_NO, AT(repeat_points), 0, 0, "no", 0, "after an interruption take a place that was not finished anew, instead of only what is missing"},
    {"chain", "before", KEY_TEXT, AT(before), 0, 0, "", 0, "shell command run before the capture and at every make: builds a scene, say"},
    {"chain", "beside", KEY_TEXT, AT(beside), 0, 0, "", 0, "program run beside the capture and ended after it: a virtual stage, say"},
    {"chain", "hdrgen", KEY_TEXT, AT(hdrgen), 0, 0, "", 0, "options of hdrgen"},
    {"chain", "fishremap", KEY_TEXT, AT(fishremap), 0, 0, "--size 256x64", 0, "options of fishremap; --lens and --fov are the camera's where they are left out"},
    {"chain", "ilfpack", KEY_TEXT, AT(ilfpack), 0, 0, "--type half", 0, "options of ilfpack"},
    {"chain", "ilflamps", KEY_TEXT, AT(ilflamps), 0, 0, "", 0, "options of ilflamps, which then writes the light field a second time, its lamps taken out; empty = it is not run"},
    {"chain", "light_field", KEY_TEXT, AT(light_field), 0, 0, "room.ilf.exr", 0, "name of the light field in the folder"},
    {"chain", "next", KEY_TEXT, AT(next), 0, 0, "", 0, "adaptive: shell command run between rounds, which puts nodes on the list positions.txt in the folder or leaves it; empty = the rules' own choice"},
    {0}};
/* clang-format on */

static int take_numbers(double *v, int n, const session_key *k, const char *value, errmsg *e)
{
    double t[9];
    if (cli_parse_doubles(t, n, value, " ", e) != 0) return -1;
    for (int i = 0; i < n; i++)
        if (!(t[i] >= k->least && t[i] <= k->most) || fabs(t[i]) > huge)
            return err_set(e, "expected %g to %g, found %g", k->least, k->most, t[i]);
    memcpy(v, t, (size_t)n * sizeof *v);
    return 0;
}

static int take_choice(int *v, const char *value, const char *const *names, errmsg *e)
{
    for (int i = 0; names[i]; i++)
        if (!strcmp(value, names[i])) {
            *v = i;
            return 0;
        }
    return err_set(e, "expected %s or %s, found '%s'", names[0], names[1], value);
}

static const char *const no_yes[] = {"no", "yes", NULL}, *const off_on[] = {"off", "on", NULL},
                         *const orders[] = {"serpentine", "raster", NULL},
                         *const checks[] = {"decode", "size", NULL},
                         *const sources[] = {"asked", "exif", NULL},
                         *const actions[] = {"stop", "skip", NULL};

static int take_text(char **v, const char *value, errmsg *e)
{
    char *copy = strdup(value);
    if (!copy) return err_set(e, "out of memory");
    free(*v);
    *v = copy;
    return 0;
}

static int take_axes(session *s, const char *value, errmsg *e)
{
    const char *p = value;
    for (int a = 0; a < 2; a++) {
        p += strspn(p, " \t");
        s->sign[a] = *p == '-' ? -1 : 1;
        p += *p == '-' || *p == '+';
        if (*p != 'x' && *p != 'y') return err_set(e, "expected x and y, found '%s'", value);
        s->axis[a] = *p++ == 'y';
    }
    if (*p || s->axis[0] == s->axis[1]) return err_set(e, "expected x and y, found '%s'", value);
    return take_text(&s->axes, value, e);
}

int session_take(session *s, const session_key *k, const char *value, errmsg *e)
{
    void *at = (char *)s + k->offset;
    double v;
    switch ((key_kind)k->kind) {
    case KEY_TEXT: return take_text(at, value, e);
    case KEY_NUMBER: return take_numbers(at, 1, k, value, e);
    case KEY_NUMBERS2: return take_numbers(at, 2, k, value, e);
    case KEY_NUMBERS4: return take_numbers(at, 4, k, value, e);
    case KEY_NUMBERS9: return take_numbers(at, 9, k, value, e);
    case KEY_WHOLE:
        if (take_numbers(&v, 1, k, value, e) != 0) return -1;
        if (v != floor(v)) return err_set(e, "expected a whole number, found '%s'", value);
        *(int *)at = (int)v;
        return 0;
    case KEY_SIZE: {
        int n[2];
        if (cli_parse_size(&n[0], &n[1], value, e) != 0) return -1;
        if (n[0] > k->most || n[1] > k->most || (double)n[0] * n[1] > 1e6)
            return err_set(e, "expected at most a million nodes, found %s", value);
        memcpy(at, n, sizeof n);
        return 0;
    }
    case KEY_YES_NO: return take_choice(at, value, no_yes, e);
    case KEY_ON_OFF: return take_choice(at, value, off_on, e);
    case KEY_ORDER: return take_choice(at, value, orders, e);
    case KEY_CHECK: return take_choice(at, value, checks, e);
    case KEY_TIMES: return take_choice(at, value, sources, e);
    case KEY_ON_FAIL: return take_choice(at, value, actions, e);
    case KEY_AXES: return take_axes(s, value, e);
    case KEY_EXPOSURES:
        if (exposures_parse(s->exposure, &s->exposures, value, e) != 0) return -1;
        return take_text(at, value, e);
    }
    return err_set(e, "not a key");
}

void session_value(char *out, size_t room, const session *s, const session_key *k)
{
    const void *at = (const char *)s + k->offset;
    int count = 1;
    size_t n = 0;
    out[0] = 0;
    switch ((key_kind)k->kind) {
    case KEY_TEXT:
    case KEY_AXES: snprintf(out, room, "%s", *(char *const *)at); return;
    case KEY_WHOLE: snprintf(out, room, "%d", *(const int *)at); return;
    case KEY_SIZE: snprintf(out, room, "%dx%d", ((const int *)at)[0], ((const int *)at)[1]); return;
    case KEY_YES_NO: snprintf(out, room, "%s", no_yes[*(const int *)at]); return;
    case KEY_ON_OFF: snprintf(out, room, "%s", off_on[*(const int *)at]); return;
    case KEY_ORDER: snprintf(out, room, "%s", orders[*(const int *)at]); return;
    case KEY_CHECK: snprintf(out, room, "%s", checks[*(const int *)at]); return;
    case KEY_TIMES: snprintf(out, room, "%s", sources[*(const int *)at]); return;
    case KEY_ON_FAIL: snprintf(out, room, "%s", actions[*(const int *)at]); return;
    case KEY_EXPOSURES:
        at = s->exposure;
        count = s->exposures;
        break;
    case KEY_NUMBER: break;
    case KEY_NUMBERS2: count = 2; break;
    case KEY_NUMBERS4: count = 4; break;
    case KEY_NUMBERS9: count = 9; break;
    }
    for (int i = 0; i < count && n < room; i++)
        n += (size_t)snprintf(out + n, room - n, "%s%.17g", i ? " " : "", ((const double *)at)[i]);
}
