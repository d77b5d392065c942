#include "xcp.h"

#include <string.h>

#include "board.h"

enum {
    CONNECT = 0xFF,
    DISCONNECT = 0xFE,
    GET_STATUS = 0xFD,
    SYNCH = 0xFC,
    SET_MTA = 0xF6,
    SHORT_UPLOAD = 0xF4,
    DOWNLOAD = 0xF0,
    SHORT_DOWNLOAD = 0xED
};
enum { POSITIVE = 0xFF, ERROR = 0xFE };
enum {
    ERR_SYNCH = 0x00,
    ERR_UNKNOWN = 0x20,
    ERR_SYNTAX = 0x21,
    ERR_RANGE = 0x22,
    ERR_ACCESS = 0x24
};

static uint32_t refuse(uint8_t *answer, uint8_t code)
{
    answer[0] = ERROR;
    answer[1] = code;
    return 2u;
}

static int32_t is_inside(xcp_area area, uint32_t address, uint32_t size)
{
    const uint32_t first = (uint32_t)area.first;
    const uint32_t last = (uint32_t)area.last;
    return ((address >= first) && (address <= last) && (size <= (last - address))) ? 1 : 0;
}

static uint32_t address_in(const uint8_t *packet)
{
    uint32_t address;
    (void)memcpy(&address, &packet[4], sizeof(address));
    return address;
}

static uint32_t write(xcp_slave *slave, const uint8_t *data, uint32_t size, uint8_t *answer)
{
    if (is_inside(slave->write, slave->address, size) == 0) {
        return refuse(answer, ERR_ACCESS);
    }
    (void)memcpy((uint8_t *)slave->address, data, size);
    slave->address += size;
    return 1u;
}

static uint32_t upload(const xcp_slave *slave, const uint8_t *packet, uint8_t *answer)
{
    const uint32_t size = packet[1];
    const uint32_t address = address_in(packet);
    if (size > (XCP_MOST - 1u)) {
        return refuse(answer, ERR_RANGE);
    }
    if (is_inside(slave->read, address, size) == 0) {
        return refuse(answer, ERR_ACCESS);
    }
    (void)memcpy(&answer[1], (const uint8_t *)address, size);
    return size + 1u;
}

static uint32_t connected(xcp_slave *slave, const uint8_t *packet, uint32_t length, uint8_t *answer)
{
    static const uint8_t resources[] = {1u, 0u, XCP_MOST, XCP_MOST, 0u, 1u, 1u}; /* calibration */
    static const uint8_t status[] = {0u, 0u, 0u, 0u, 0u};
    const uint32_t rest = (length > 8u) ? (length - 8u) : 0u;
    uint32_t used = 1u;
    switch (packet[0]) {
    case CONNECT:
        (void)memcpy(&answer[1], resources, sizeof(resources));
        used = sizeof(resources) + 1u;
        break;
    case DISCONNECT:
        slave->is_connected = 0;
        break;
    case GET_STATUS:
        (void)memcpy(&answer[1], status, sizeof(status));
        used = sizeof(status) + 1u;
        break;
    case SYNCH:
        used = refuse(answer, ERR_SYNCH);
        break;
    case SET_MTA:
        slave->address = (length == 8u) ? address_in(packet) : 0u;
        used = (length == 8u) ? 1u : refuse(answer, ERR_SYNTAX);
        break;
    case SHORT_UPLOAD:
        used = (length == 8u) ? upload(slave, packet, answer) : refuse(answer, ERR_SYNTAX);
        break;
    case DOWNLOAD:
        used = ((length >= 2u) && ((length - 2u) == packet[1]))
                   ? write(slave, &packet[2], length - 2u, answer)
                   : refuse(answer, ERR_SYNTAX);
        break;
    case SHORT_DOWNLOAD:
        if ((length < 8u) || (rest != packet[1])) {
            used = refuse(answer, ERR_SYNTAX);
        } else {
            slave->address = address_in(packet);
            used = write(slave, &packet[8], rest, answer);
        }
        break;
    default:
        used = refuse(answer, ERR_UNKNOWN);
        break;
    }
    return used;
}

uint32_t xcp_answer(xcp_slave *slave, const uint8_t *packet, uint32_t length, uint8_t *answer)
{
    uint32_t used = 0u; /* without a connection no other command is answered */
    if (packet[0] == CONNECT) {
        slave->is_connected = 1;
    }
    if (slave->is_connected != 0) {
        answer[0] = POSITIVE;
        used = connected(slave, packet, length, answer);
    }
    return used;
}

void xcp_serve(xcp_slave *slave)
{
    uint8_t packet[XCP_MOST];
    uint8_t answer[XCP_MOST];
    uint32_t length = 0u;
    int32_t is_whole = 0;
    while (is_whole == 0) {
        length = board_receive();
        uint8_t sum = (uint8_t)length;
        for (uint32_t i = 0; i < length; i++) {
            const uint8_t byte = board_receive();
            packet[i % XCP_MOST] = byte;
            sum = (uint8_t)(sum + byte);
        }
        const uint8_t check = board_receive();
        is_whole = ((length > 0u) && (length <= XCP_MOST) && (check == sum)) ? 1 : 0;
    }
    const uint32_t used = xcp_answer(slave, packet, length, answer);
    if (used > 0u) {
        uint8_t sum = (uint8_t)used;
        board_send((uint8_t)used);
        for (uint32_t i = 0; i < used; i++) {
            board_send(answer[i]);
            sum = (uint8_t)(sum + answer[i]);
        }
        board_send(sum);
    }
}
