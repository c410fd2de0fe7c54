"""Agents in other languages, and such as import the course's file."""

LINK = """
    import sys
    from ciberrato.croblink import *
    robot = CRobLinkAngs("link", 1, [0, 60, -60, 180], sys.argv[1])
    if robot.status != 0:
        sys.exit("refused")
    while True:
        robot.readSensors()
        robot.driveMotors(-0.1 if robot.measures.irSensor[0] > 1.2 else 0.1, 0.1)
"""
SIX_LINES = """
    import sys
    from ciberrato import Robot
    with Robot("r2", host=sys.argv[1]) as robot:
        for measures in robot:
            robot.drive(0.1, 0.1 if measures.infrared[0] < 2 else -0.1)
"""
PERL = r"""
    use strict; use warnings; use Socket;
    my ($host, $port) = split /:/, $ARGV[0];
    socket(my $link, PF_INET, SOCK_DGRAM, 0) or die;
    send($link, '<Robot Id="1" Name="perl"/>', 0, sockaddr_in($port, inet_aton($host)));
    setsockopt($link, SOL_SOCKET, SO_RCVTIMEO, pack('l!l!', 2, 0));
    my $simulator = recv($link, my $reply, 4096, 0) // exit 1;
    exit 1 unless $reply =~ /Status="Ok"/;
    my ($end) = $reply =~ /SimTime="(\d+)"/;
    while (defined recv($link, my $data, 4096, 0)) {
        my ($time) = $data =~ /Time="(\d+)"/;
        exit 0 if $time >= $end;
        my ($front) = $data =~ /Id="0" Value="([^"]+)"/;
        my $right = $front > 1.2 ? -0.1 : 0.1;
        send($link, "<Actions LeftMotor=\"0.1\" RightMotor=\"$right\"/>", 0, $simulator);
    }
"""
C = r"""
    #include <arpa/inet.h>
    #include <stdio.h>
    #include <stdlib.h>
    #include <string.h>
    #include <sys/time.h>
    int main(int argc, char **argv) {
        struct sockaddr_in to = {0}, from;
        struct timeval wait = {2, 0};
        char data[4097];
        int s = socket(AF_INET, SOCK_DGRAM, 0), end = 0;
        setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
        to.sin_family = AF_INET;
        to.sin_port = htons(atoi(argv[2]));
        inet_pton(AF_INET, argv[1], &to.sin_addr);
        const char *hello = "<Robot Id=\"1\" Name=\"c\"/>";
        sendto(s, hello, strlen(hello) + 1, 0, (struct sockaddr *)&to, sizeof to);
        for (;;) {
            socklen_t n = sizeof from;
            ssize_t got = recvfrom(s, data, sizeof data - 1, 0, (struct sockaddr *)&from, &n);
            if (got < 0) return 0;
            data[got] = 0;
            char *text;
            if (strstr(data, "Refused")) return 1;
            if ((text = strstr(data, "SimTime=\""))) end = atoi(text + 9);
            if (!strncmp(data, "<Measures Time=\"", 16)) {
                if (end && atoi(data + 16) >= end) return 0;
                text = strstr(data, "Id=\"0\" Value=\"");
                int wall = text && atof(text + 14) > 1.2;
                char go[100];
                sprintf(go, "<Actions LeftMotor=\"0.1\" RightMotor=\"%s0.1\"/>", wall ? "-" : "");
                sendto(s, go, strlen(go) + 1, 0, (struct sockaddr *)&from, n);
            }
        }
    }
"""
