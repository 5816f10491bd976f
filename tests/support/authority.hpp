#pragma once
#include <filesystem>
#include <string>

namespace ise_test {

/// When a certificate or a list is valid, as openssl takes it: the years that virtual and real clocks show.
struct validity {
    std::string from = "20170101000000Z", until = "21000101000000Z";
    validity() = default;
    validity(std::string begin, std::string end) : from(std::move(begin)), until(std::move(end)) {}
};

/// A certificate authority of a test, made by the command `openssl` in a folder of its own: as somebody would who reads
/// docs/security.md. Throws where a command fails, with what it printed.
class authority {
public:
    explicit authority(const std::string& name = "authority");
    ~authority();
    authority(const authority&) = delete;
    authority& operator=(const authority&) = delete;

    /// A folder with ca.pem, certificate.pem and key.pem; `names` is the subjectAltName.
    std::filesystem::path issue(const std::string& name, const std::string& names = everywhere,
                                const validity& valid = validity(), const std::string& usage = "serverAuth,clientAuth");
    /// The same, with so many authorities between this one and the certificate, which are shown with it.
    std::filesystem::path issue_below(const std::string& name, int authorities);
    /// From the next `list()` on the certificate is in it.
    void revoke(const std::string& name);
    /// A revocation list; whoever is to look into it has it behind the authority in ca.pem.
    std::string list(const validity& valid = validity());
    /// Its own certificate.
    std::string certificate() const;
    /// Puts another ca.pem into the folder of `name`.
    void believe(const std::string& name, const std::string& authorities) const;

    /// Localhost, and the hosts boat and shore.
    static constexpr const char* everywhere =
        "DNS:boat,DNS:shore,DNS:localhost,IP:127.0.0.1,IP:::1,IP:10.0.0.1,IP:10.0.0.2";

private:
    void run(const std::string& words) const;

    std::filesystem::path folder_;
};

std::string read_all(const std::filesystem::path& file);

} // namespace ise_test
