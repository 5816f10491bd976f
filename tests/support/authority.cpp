#include <support/authority.hpp>

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <random>
#include <sstream>
#include <stdexcept>

namespace ise_test {
namespace {

void write(const std::filesystem::path& file, const std::string& text) {
    std::ofstream to(file, std::ios::binary);
    to << text;
    if (!to.flush()) throw std::runtime_error("cannot write " + file.string());
}

constexpr const char* settings = R"([ca]
default_ca = here
[here]
database = index.txt
new_certs_dir = .
certificate = ca.pem
private_key = ca-key.pem
serial = serial
default_md = sha256
default_days = 1
policy = any
unique_subject = no
copy_extensions = copy
[any]
commonName = supplied
[authority]
basicConstraints = critical, CA:TRUE
keyUsage = critical, keyCertSign, cRLSign
subjectKeyIdentifier = hash
[req]
distinguished_name = nothing
[nothing]
)";

} // namespace

std::string read_all(const std::filesystem::path& file) {
    std::ifstream from(file, std::ios::binary);
    std::ostringstream text;
    text << from.rdbuf();
    if (!from) throw std::runtime_error("cannot read " + file.string());
    return text.str();
}

authority::authority(const std::string& name) {
    std::random_device draw; // another authority may have the same process id: in a namespace of its own
    do folder_ = std::filesystem::temp_directory_path() / fmt::format("ise-authority-{:08x}", draw());
    while (!std::filesystem::create_directory(folder_));
    std::filesystem::permissions(folder_, std::filesystem::perms::owner_all);
    write(folder_ / "settings", settings);
    write(folder_ / "index.txt", "");
    write(folder_ / "serial", "01\n");
    run(fmt::format("req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -config settings -subj '/CN={}' "
                    "-keyout ca-key.pem -out ca.csr",
                    name));
    validity valid;
    run(fmt::format("ca -selfsign -batch -notext -config settings -extensions authority -startdate {} -enddate {} -in "
                    "ca.csr -out ca.pem",
                    valid.from, valid.until));
}

authority::~authority() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
}

void authority::run(const std::string& words) const {
    auto line = fmt::format("cd '{}' && openssl {} > log 2>&1 < /dev/null", folder_.string(), words);
    if (std::system(line.c_str()) != 0)
        throw std::runtime_error(fmt::format("openssl {}: {}", words, read_all(folder_ / "log")));
}

std::filesystem::path authority::issue(const std::string& name, const std::string& names, const validity& valid,
                                       const std::string& usage) {
    auto own = folder_ / name;
    std::filesystem::create_directory(own);
    run(fmt::format("req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -config settings -subj '/CN={0}' "
                    "-addext 'subjectAltName={1}' "
                    "-addext 'extendedKeyUsage={2}' -keyout {0}/key.pem -out {0}/request.csr",
                    name, names, usage));
    run(fmt::format(
        "ca -batch -notext -config settings -startdate {1} -enddate {2} -in {0}/request.csr -out {0}/certificate.pem",
        name, valid.from, valid.until));
    believe(name, certificate());
    return own;
}

std::filesystem::path authority::issue_below(const std::string& name, int authorities) {
    auto own = issue(name);
    validity valid;
    std::string issuer = "ca", shown;
    auto sign = [&](const std::string& request, const std::string& made, const std::string& as) {
        run(fmt::format("ca -batch -notext -config settings {} -cert {}.pem -keyfile {}-key.pem -startdate {} -enddate "
                        "{} -in {} -out {}",
                        as, issuer, issuer, valid.from, valid.until, request, made));
    };
    for (int i = 1; i <= authorities; ++i) {
        auto next = fmt::format("below{}", i);
        run(fmt::format("req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -config settings -subj "
                        "/CN={0} -keyout {0}-key.pem -out {0}.csr",
                        next));
        sign(next + ".csr", next + ".pem", "-extensions authority");
        shown = read_all(folder_ / (next + ".pem")) + shown;
        issuer = next;
    }
    sign(name + "/request.csr", name + "/certificate.pem", "");
    write(own / "certificate.pem", read_all(own / "certificate.pem") + shown);
    return own;
}

void authority::revoke(const std::string& name) {
    run(fmt::format("ca -config settings -revoke {}/certificate.pem", name));
}

std::string authority::list(const validity& valid) {
    run(fmt::format("ca -config settings -gencrl -crl_lastupdate {} -crl_nextupdate {} -out list.pem", valid.from,
                    valid.until));
    return read_all(folder_ / "list.pem");
}

std::string authority::certificate() const { return read_all(folder_ / "ca.pem"); }
void authority::believe(const std::string& name, const std::string& authorities) const {
    write(folder_ / name / "ca.pem", authorities);
}

} // namespace ise_test
