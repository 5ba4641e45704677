/* grbl_proto.c - the tables and the parser of grbl_proto.h (pure). */
#include "grbl_proto.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Meanings in our own words; numbering as published for GRBL 1.1. */
static const char *const errors[] = {
    [1] = "a command word without its letter",
    [2] = "a number is missing or malformed",
    [3] = "an unknown or unsupported $ command",
    [4] = "a value that must be positive is negative",
    [5] = "homing is switched off ($22=0)",
    [6] = "step pulse time is below 3 us",
    [7] = "settings could not be read from EEPROM and were reset to defaults",
    [8] = "this $ command needs the stage to be idle",
    [9] = "locked: the stage is in alarm or jogging (home it, or 'stagectl unlock')",
    [10] = "soft limits need homing to be switched on",
    [11] = "the line is too long",
    [12] = "the step rate of this setting is too high",
    [13] = "a safety door is open",
    [14] = "build info or start-up line is too long",
    [15] = "jog target is outside the travel",
    [16] = "malformed jog command",
    [17] = "laser mode needs PWM output",
    [20] = "an unsupported or invalid G-code word",
    [21] = "two G-codes of one group on a line",
    [22] = "no feed rate is set",
    [23] = "this G-code needs a whole number",
    [24] = "two G-codes that need axis words on one line",
    [25] = "a word is repeated",
    [26] = "axis words are missing",
    [27] = "line number out of range",
    [28] = "a value word is missing",
    [29] = "work coordinate system not supported",
    [30] = "G53 is allowed with G0 and G1 only",
    [31] = "axis words that no command uses",
    [32] = "an arc without axis words in its plane",
    [33] = "invalid motion target",
    [34] = "arc radius can't be right",
    [35] = "an arc without offset words in its plane",
    [36] = "value words that no command uses",
    [37] = "tool length offset on the wrong axis",
    [38] = "tool number out of range",
};

static const char *const alarms[] = {
    [1] = "hard limit: a limit switch was hit in motion; the position is lost",
    [2] = "soft limit: the target is outside the travel; the position is kept",
    [3] = "reset while in motion; the position is lost",
    [4] = "probe failed: not in its initial state",
    [5] = "probe failed: no contact within the travel",
    [6] = "homing failed: reset during homing",
    [7] = "homing failed: safety door opened",
    [8] = "homing failed: the switch did not clear when pulling off",
    [9] = "homing failed: no switch found within the search distance",
    [10] = "homing failed: second switch of a dual axis not found",
};

static const struct {
    const char *name;
    grbl_state state;
} states[] = {{"Idle", GRBL_IDLE},   {"Run", GRBL_RUN},       {"Hold", GRBL_HOLDING}, {"Jog", GRBL_JOG},
              {"Home", GRBL_HOMING}, {"Alarm", GRBL_ALARMED}, {"Check", GRBL_CHECK},  {"Door", GRBL_DOOR},
              {"Sleep", GRBL_SLEEP}, {"Tool", GRBL_TOOL}};

const char *grbl_error_words(int n)
{
    int known = n > 0 && n < (int)(sizeof errors / sizeof *errors) && errors[n];
    return known ? errors[n] : "no published meaning";
}

const char *grbl_alarm_words(int n)
{
    int known = n > 0 && n < (int)(sizeof alarms / sizeof *alarms) && alarms[n];
    return known ? alarms[n] : "no published meaning";
}

const char *grbl_state_name(grbl_state s)
{
    if (s == GRBL_HELD) return "Hold";
    for (size_t i = 0; i < sizeof states / sizeof *states; i++)
        if (states[i].state == s) return states[i].name;
    return "unknown";
}

const char *grbl_state_words(grbl_state s)
{
    switch (s) {
    case GRBL_HOLDING:
    case GRBL_HELD:
        return "somebody pressed feed hold; the next stagectl resets it, and its position is kept";
    case GRBL_DOOR: return "the safety door is open, or its input says so; close it";
    case GRBL_SLEEP:
        return "it was sent to sleep ($SLP) with its motors off; the next stagectl wakes it, then home it";
    case GRBL_CHECK: return "check mode ($C) moves nothing; the next stagectl ends it";
    case GRBL_TOOL: return "it waits for a change of tools";
    case GRBL_ALARMED: return "home it, or 'stagectl unlock' if it stands where it says";
    default: return NULL;
    }
}

/* Whole number to the end of the text, or -1. */
static int number_at(const char *s)
{
    char *end;
    long v = strtol(s, &end, 10);
    return end == s || *end || v < 0 || v > 100000 ? -1 : (int)v;
}

/* "1.0,2.0,..." up to '|' or the end; number of values or 0. */
static int numbers_at(double v[GRBL_AXES], const char *s)
{
    int n = 0;
    for (;;) {
        char *end;
        double x = strtod(s, &end);
        if (end == s || !isfinite(x) || n == GRBL_AXES) return 0;
        v[n++] = x;
        if (*end != ',') return *end == '|' || *end == 0 ? n : 0;
        s = end + 1;
    }
}

/* <State[:sub]|field|field...>, with the closing bracket there. */
static int parse_status(grbl_message *m, const char *line)
{
    char buf[300];
    size_t len = strlen(line);
    if (len < 3 || line[len - 1] != '>' || len >= sizeof buf) return 0;
    memcpy(buf, line + 1, len - 2);
    buf[len - 2] = 0;
    size_t name = strcspn(buf, ":|");
    m->state = GRBL_OTHER;
    for (size_t i = 0; i < sizeof states / sizeof *states; i++)
        if (strlen(states[i].name) == name && !strncmp(buf, states[i].name, name)) m->state = states[i].state;
    if (m->state == GRBL_OTHER) return 0;
    m->sub = buf[name] == ':' ? atoi(buf + name + 1) : -1;
    if (m->state == GRBL_HOLDING && m->sub == 0) m->state = GRBL_HELD;
    for (char *f = strchr(buf, '|'); f; f = strchr(f + 1, '|')) {
        if (!strncmp(f, "|MPos:", 6) || !strncmp(f, "|WPos:", 6)) {
            m->is_work = f[1] == 'W';
            m->axes = numbers_at(m->pos, f + 6);
            if (m->axes == 0) return 0;
        } else if (!strncmp(f, "|WCO:", 5)) {
            if (numbers_at(m->offset, f + 5) == 0) return 0;
            m->has_offset = 1;
        } else if (!strncmp(f, "|Pn:", 4)) {
            for (const char *p = f + 4; *p && *p != '|'; p++) m->limits |= *p == 'X' ? 1 : *p == 'Y' ? 2 : 0;
        }
    }
    return m->axes >= 2;
}

/* "Grbl 1.1h ['$' for help]", "GrblHAL 1.1f ..."; 0.9 speaks another status language. */
static int parse_banner(grbl_message *m, const char *line)
{
    if (strncasecmp(line, "grbl", 4) != 0) return 0;
    const char *p = line + 4;
    if (!strncasecmp(p, "hal", 3)) p += 3;
    if (*p != ' ') return 0;
    char *end;
    double v = strtod(p, &end);
    if (end == p) return 0;
    m->supported = v >= 1.1 - 1e-9;
    return 1;
}

void grbl_parse(grbl_message *m, const char *line)
{
    memset(m, 0, sizeof *m);
    m->text = line;
    m->kind = GRBL_NOISE;
    if (!strcmp(line, "ok")) {
        m->kind = GRBL_OK;
    } else if (!strncmp(line, "error:", 6)) {
        m->number = number_at(line + 6);
        m->kind = GRBL_ERROR; /* a damaged number is still a refusal */
    } else if (!strncmp(line, "ALARM:", 6)) {
        m->number = number_at(line + 6);
        m->kind = GRBL_ALARM;
    } else if (line[0] == '<') {
        if (parse_status(m, line)) m->kind = GRBL_STATUS;
    } else if (line[0] == '[') {
        m->kind = !strncmp(line, "[GC:", 4)                  ? GRBL_MODES
                  : !strncmp(line, "[MSG:Reset to cont", 18) ? GRBL_RESETTABLE
                                                             : GRBL_FEEDBACK;
    } else if (line[0] == '>') {
        m->kind = GRBL_ECHO;
    } else if (line[0] == '$') {
        char *end;
        long n = strtol(line + 1, &end, 10);
        if (end > line + 1 && *end == '=' && n >= 0 && n < 100000) {
            m->number = (int)n;
            m->value = strtod(end + 1, NULL);
            if (isfinite(m->value)) m->kind = GRBL_SETTING;
        }
    } else if (parse_banner(m, line)) {
        m->kind = GRBL_BANNER;
    }
}

/* Units, distance mode and coordinates stand in each line: a start-up line of the user's ($N0=G20 ...) or a
 * work offset can't change what it means. */
size_t grbl_format_move(char *out, size_t room, const double xy[2], double feed)
{
    int n = snprintf(out, room, "G21G90G94G53G1X%.4fY%.4fF%.1f\n", xy[0] + 0.0, xy[1] + 0.0, feed);
    return n > 0 && (size_t)n < room ? (size_t)n : 0;
}

size_t grbl_format_dwell(char *out, size_t room, double seconds)
{
    int n = snprintf(out, room, "G4P%.3f\n", fmax(seconds, 0.001));
    return n > 0 && (size_t)n < room ? (size_t)n : 0;
}
