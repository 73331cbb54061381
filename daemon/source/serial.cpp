// SPDX-License-Identifier: Apache-2.0
#include "source/serial.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>

namespace gw {

namespace {
speed_t speed_of(long baud) {
    switch (baud) {
        case 9600: return B9600;
        case 19200: return B19200;
        case 38400: return B38400;
        case 57600: return B57600;
        case 115200: return B115200;
        case 230400: return B230400;
        case 460800: return B460800;
        case 921600: return B921600;
        case 1000000: return B1000000;
        case 2000000: return B2000000;
        case 3000000: return B3000000;
        default: return 0;
    }
}
}  // namespace

Fd open_serial(const std::string& device, long baud, std::string& error) {
    const speed_t speed = speed_of(baud);
    if (speed == 0) return error = "baud " + std::to_string(baud) + " is not supported; use 9600 to 3000000 in the usual steps", Fd();
    Fd fd(open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!fd) return error = device + ": " + strerror(errno) + "; plug the adapter in, and let the daemon's user be in group dialout", Fd();
    termios t{};
    if (tcgetattr(fd.get(), &t) < 0) return error = device + " is no serial device", Fd();
    cfmakeraw(&t);
    t.c_cflag |= CLOCAL | CREAD;
    t.c_cflag &= ~tcflag_t(CRTSCTS);
    t.c_cc[VMIN] = 0, t.c_cc[VTIME] = 0;
    cfsetspeed(&t, speed);
    if (tcsetattr(fd.get(), TCSANOW, &t) < 0) return error = device + ": " + strerror(errno) + "; choose another baud", Fd();
    ioctl(fd.get(), TIOCEXCL);
    tcflush(fd.get(), TCIOFLUSH);
    return fd;
}

}  // namespace gw
