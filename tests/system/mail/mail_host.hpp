#pragma once
#include <support/program.hpp>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

/// Real mail servers of Debian on loopback, for one test: OpenSMTPD takes mails for example.org, dovecot's submission
/// server stands before it (TLS, logins), and dovecot's IMAP server gives them out. Free ports, a folder of its own, a
/// mount namespace of its own for what OpenSMTPD has built in. Needs root.
class mail_host {
public:
    /// Why it cannot be had here; nothing where it can.
    static std::optional<std::string> missing();

    mail_host();
    ~mail_host();

    void start();
    void kill(); ///< all of it at once, as when the power fails; what was delivered stays

    /// Puts a file into a user's mailbox, as it is.
    void put(const std::string& user, const std::string& raw);
    /// Mails of a user's folder, as files: "" is the INBOX.
    std::size_t count(const std::string& user, const std::string& folder = {}) const;

    std::string imaps() const { return "imaps://localhost:" + std::to_string(imaps_); }
    std::string imap() const { return "imap://localhost:" + std::to_string(imap_); }
    std::string smtps() const { return "smtps://localhost:" + std::to_string(smtps_); }
    std::string smtp() const { return "smtp://localhost:" + std::to_string(submission_); }
    std::string certificate() const { return (folder_ / "cert.pem").string(); }
    std::string other_certificate() const { return (folder_ / "other.pem").string(); }

private:
    std::string dovecot_conf() const;
    void write(const std::string& name, const std::string& text) const;

    std::filesystem::path folder_;
    int imap_ = 0, imaps_ = 0, submission_ = 0, smtps_ = 0, relay_ = 0;
    std::unique_ptr<ise_test::program> servers_;
};
