#include "mail_host.hpp"

#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <vector>

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

namespace {

/// Ports that were free a moment ago.
std::vector<int> free_ports(std::size_t count) {
    std::vector<int> sockets, ports;
    for (std::size_t i = 0; i < count; ++i) {
        int one = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        sockaddr_in at{};
        at.sin_family = AF_INET;
        at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof at;
        if (one < 0 || ::bind(one, reinterpret_cast<sockaddr*>(&at), size) != 0 ||
            ::getsockname(one, reinterpret_cast<sockaddr*>(&at), &size) != 0)
            throw std::runtime_error("no free port");
        sockets.push_back(one);
        ports.push_back(ntohs(at.sin_port));
    }
    for (int one : sockets) ::close(one);
    return ports;
}

bool answers(int port) {
    int one = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(static_cast<std::uint16_t>(port));
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    bool there = ::connect(one, reinterpret_cast<sockaddr*>(&at), sizeof at) == 0;
    ::close(one);
    return there;
}

void run(std::vector<std::string> command) {
    auto ran = ise_test::run_program(std::move(command));
    if (ran.exit_code != 0) throw std::runtime_error("mail_host: " + ran.err);
}

} // namespace

std::optional<std::string> mail_host::missing() {
    if (::geteuid() != 0) return "mail servers are started as root only (OpenSMTPD, and a mount namespace)";
    for (const char* file : {"/usr/sbin/dovecot", "/usr/sbin/smtpd", "/usr/lib/dovecot/submission", "/usr/bin/openssl",
                             "/usr/bin/unshare"})
        if (::access(file, X_OK) != 0) return fmt::format("{} is not installed", file);
    if (ise_test::run_program({"/usr/bin/unshare", "--mount", "/bin/true"}).exit_code != 0)
        return "no mount namespace can be made here";
    return std::nullopt;
}

mail_host::mail_host() {
    char name[] = "/tmp/ise-mail-XXXXXX";
    if (!::mkdtemp(name)) throw std::runtime_error("no temporary folder");
    folder_ = name;
    ::chmod(name, 0755);
    for (const char* one : {"home", "run"}) std::filesystem::create_directory(folder_ / one);
    run({"/bin/chown", "nobody", (folder_ / "home").string()});
    for (auto [file, names] : {std::pair("cert", "DNS:localhost,IP:127.0.0.1"), std::pair("other", "DNS:localhost")})
        run({"/usr/bin/openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
             "-keyout", (folder_ / file).string() + ".key", "-out", (folder_ / file).string() + ".pem", "-days", "2",
             "-subj", "/CN=localhost", "-addext", std::string("subjectAltName=") + names});
    auto ports = free_ports(5);
    imap_ = ports[0], imaps_ = ports[1], submission_ = ports[2], smtps_ = ports[3], relay_ = ports[4];
    auto at = folder_.string();
    write("users", "boat:{PLAIN}secret\nshore:{PLAIN}secret\n");
    write("smtpd.conf",
          fmt::format("table nobodies {{ \"@\" = \"nobody\" }}\n"
                      "listen on 127.0.0.1 port {} hostname localhost\n"
                      "action \"box\" maildir \"{}/home/%{{dest.user:lowercase}}/Maildir\" virtual <nobodies>\n"
                      "match from any for domain \"example.org\" action \"box\"\n",
                      relay_, at));
    write("dovecot.conf", dovecot_conf());
    // Both servers have fixed paths (/var/spool/smtpd, /run/smtpd.sock): file systems of their own are mounted there.
    write("start",
          fmt::format("set -e\n"
                      "mount -t tmpfs tmpfs /var/spool\nmkdir -m 711 /var/spool/smtpd\nmount -t tmpfs tmpfs /run\n"
                      "smtpd -d -f {0}/smtpd.conf &\nexec dovecot -F -c {0}/dovecot.conf\n",
                      at));
}

// Dovecot 2.4 (Debian 13) renamed settings and refuses the old names.
std::string mail_host::dovecot_conf() const {
    const auto at = folder_.string();
    const bool newer = !ise_test::run_program({"/usr/sbin/dovecot", "--version"}).out.starts_with("2.3");
    const auto* listen = newer ? "listen" : "address";
    const auto changed = newer ? fmt::format(R"(ssl_server_cert_file = {0}/cert.pem
ssl_server_key_file = {0}/cert.key
mail_driver = maildir
mail_path = ~/Maildir
passdb passwd-file {{
  default_password_scheme = PLAIN
  passwd_file_path = {0}/users
}}
userdb static {{
  fields {{
    uid = nobody
    gid = nogroup
    home = {0}/home/%{{user}}
  }}
}}
)",
                                             at)
                               : fmt::format(R"(ssl_cert = <{0}/cert.pem
ssl_key = <{0}/cert.key
mail_location = maildir:~/Maildir
passdb {{
  driver = passwd-file
  args = scheme=PLAIN {0}/users
}}
userdb {{
  driver = static
  args = uid=nobody gid=nogroup home={0}/home/%u
}}
)",
                                             at);
    return fmt::format(R"({6}base_dir = {0}/run
state_dir = {0}/run
log_path = {0}/dovecot.log
protocols = imap submission
ssl = yes
default_login_user = nobody
default_internal_user = nobody
default_internal_group = nogroup
first_valid_uid = 1
auth_failure_delay = 0
hostname = localhost
submission_relay_host = 127.0.0.1
submission_relay_port = {5}
{7}service anvil {{
  chroot =
}}
service imap-login {{
  chroot =
  inet_listener imap {{
    {8} = 127.0.0.1
    port = {1}
  }}
  inet_listener imaps {{
    {8} = 127.0.0.1
    port = {2}
  }}
}}
service submission-login {{
  chroot =
  inet_listener submission {{
    {8} = 127.0.0.1
    port = {3}
  }}
  inet_listener submissions {{
    {8} = 127.0.0.1
    port = {4}
    ssl = yes
  }}
}}
)",
                       at, imap_, imaps_, submission_, smtps_, relay_,
                       newer ? "dovecot_config_version = 2.4.0\ndovecot_storage_version = 2.4.0\n" : "", changed,
                       listen);
}

mail_host::~mail_host() {
    servers_.reset();
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
}

void mail_host::start() {
    servers_ = std::make_unique<ise_test::program>(std::vector<std::string>{
        "/usr/bin/unshare", "--mount", "--pid", "--fork", "--kill-child", "/bin/bash", (folder_ / "start").string()});
    for (int attempt = 0; attempt < 3000; ++attempt) {
        bool all = true;
        for (int port : {imap_, imaps_, submission_, smtps_, relay_}) all = all && answers(port);
        if (all) return;
        ::usleep(10'000);
    }
    throw std::runtime_error("the mail servers did not start");
}

void mail_host::kill() { servers_.reset(); } // with the first process of its namespace all others end

void mail_host::put(const std::string& user, const std::string& raw) {
    auto box = folder_ / "home" / user / "Maildir";
    for (const char* part : {"tmp", "cur", "new"}) std::filesystem::create_directories(box / part);
    static int number = 0;
    auto name = fmt::format("1500000000.{}.test", ++number);
    std::ofstream(box / "tmp" / name, std::ios::binary) << raw;
    run({"/bin/chown", "-R", "nobody", (folder_ / "home" / user).string()});
    std::filesystem::rename(box / "tmp" / name, box / "new" / name);
}

std::size_t mail_host::count(const std::string& user, const std::string& folder) const {
    auto box = folder_ / "home" / user / "Maildir";
    if (!folder.empty()) box /= "." + folder;
    std::size_t found = 0;
    for (const char* part : {"cur", "new"}) {
        std::error_code none;
        for (std::filesystem::directory_iterator at(box / part, none), end; !none && at != end; ++at) ++found;
    }
    return found;
}

void mail_host::write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
