/* Replays the recorded trip on a board and logs each second; nothing to edit here.
 *
 * A line of the log is QPMPC1,kind,field,...*checksum and CR LF. The checksum is CRC-32 (as of zip
 * and Ethernet) of everything before the asterisk, in 8 hexadecimal digits.
 */
#include "replay.h"
#include "replay_identity.h"
#include "replay_port.h"

#define LINE_LENGTH 200u
#define CRC_POLYNOMIAL 0xEDB88320u

typedef union {
    mpc_real value;
    uint32_t words[sizeof(mpc_real) / sizeof(uint32_t)];
} real_bits;

static char line[LINE_LENGTH];
static uint32_t line_length;

static void put_character(char character)
{
    if (line_length < LINE_LENGTH) {
        line[line_length] = character;
        line_length++;
    }
}

static void put_text(const char *text)
{
    for (uint32_t k = 0u; text[k] != '\0'; k++) {
        put_character(text[k]);
    }
}

static void put_hex(uint32_t word)
{
    static const char digits[] = "0123456789abcdef";
    for (int32_t shift = 28; shift >= 0; shift -= 4) {
        put_character(digits[(word >> (uint32_t)shift) & 0xFu]);
    }
}

static void begin_line(const char *kind)
{
    line_length = 0u;
    put_text("QPMPC1,");
    put_text(kind);
}

static void text_field(const char *text)
{
    put_character(',');
    put_text(text);
}

static void number_field(uint32_t number)
{
    char digits[10];
    uint32_t count = 0u;
    uint32_t rest = number;
    do {
        digits[count] = (char)('0' + (char)(rest % 10u));
        rest /= 10u;
        count++;
    } while (rest > 0u);
    put_character(',');
    while (count > 0u) {
        count--;
        put_character(digits[count]);
    }
}

/* The bits of a number, the most significant first. */
static void real_field(mpc_real value)
{
    const uint32_t words = sizeof(mpc_real) / sizeof(uint32_t);
    real_bits bits;
    bits.value = value;
    put_character(',');
    for (uint32_t k = 0u; k < words; k++) {
        put_hex(bits.words[words - 1u - k]); /* little-endian */
    }
}

static void end_line(void)
{
    uint32_t crc = 0xFFFFFFFFu;
    for (uint32_t k = 0u; k < line_length; k++) {
        crc ^= (uint32_t)(unsigned char)line[k];
        for (uint32_t bit = 0u; bit < 8u; bit++) {
            crc = ((crc & 1u) != 0u) ? ((crc >> 1) ^ CRC_POLYNOMIAL) : (crc >> 1);
        }
    }
    put_character('*');
    put_hex(~crc);
    put_text("\r\n");
    port_write(line, line_length);
}

static void log_start(void)
{
    begin_line("start");
    text_field(REPLAY_IDENTITY);
    text_field(REPLAY_VERSION);
    text_field(REPLAY_CONTROLLER);
    text_field(MPC_F32 ? "f32" : "f64");
    number_field((uint32_t)REPLAY_SECONDS);
    text_field(port_unit());
    number_field(port_hz());
    text_field(port_name());
    end_line();
}

static void log_departure(void)
{
    uint32_t slices = 0u;
    uint32_t most = 0u;
    int32_t left = REPLAY_PREPARED;
    while (left > 0) {
        const uint32_t start = port_ticks();
        left = replay_depart();
        const uint32_t taken = port_units(port_ticks() - start);
        most = (taken > most) ? taken : most;
        slices++;
    }
    begin_line("depart");
    number_field(slices);
    number_field(most);
    end_line();
}

static void log_second(int32_t second)
{
    mpc_out out;
    port_next_second();
    const uint32_t start = port_ticks();
    (void)replay_fill(second);
    const uint32_t filled = port_ticks();
    (void)replay_decide(&out);
    const uint32_t decided = port_ticks();
    begin_line("step");
    number_field((uint32_t)second);
    number_field(port_units(filled - start));
    number_field(port_units(decided - filled));
    real_field(out.p_eng_w);
    number_field((uint32_t)out.engine_on);
    number_field((uint32_t)out.rung);
    number_field((uint32_t)out.flags);
    end_line();
}

static void log_end(void)
{
    begin_line("end");
    number_field((uint32_t)sizeof(mpc_state));
    number_field((uint32_t)sizeof(mpc_forecast));
    number_field(port_stack_bytes());
    number_field(port_flash_bytes());
    number_field(port_ram_bytes());
    end_line();
}

int32_t replay_run(void)
{
    const int32_t result = replay_begin();
    if (result == 0) {
        log_start();
        log_departure();
        for (int32_t second = 0; second < REPLAY_SECONDS; second++) {
            log_second(second);
        }
        log_end();
    }
    return result;
}
