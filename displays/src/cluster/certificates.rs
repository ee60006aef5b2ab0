//! An authority of one's own, and a certificate for each end.

use std::path::{Path, PathBuf};

use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose, date_time_ymd,
};

use super::transport::{ClusterError, End};

fn failed(error: impl std::fmt::Display) -> ClusterError {
    ClusterError::Make(error.to_string())
}

fn params(name: &str) -> Result<CertificateParams, ClusterError> {
    let mut params = CertificateParams::new(vec![name.to_string(), "localhost".to_string()]).map_err(failed)?;
    params.distinguished_name.push(DnType::CommonName, name);
    params.not_before = date_time_ymd(2020, 1, 1);
    params.not_after = date_time_ymd(2049, 12, 31);
    Ok(params)
}

/// Makes an authority, and certificates of it for the application, for displays and for applications that join, each with its key. Gives the
/// files that were written.
/// The key of the authority is not kept: to add a machine later, copy the display's files, or make all anew.
///
/// # Errors
/// A file cannot be written, or is there already: certificates that are in use are not replaced by accident.
pub fn make(folder: &Path) -> Result<Vec<PathBuf>, ClusterError> {
    let mut authority = params("Umbriel authority")?;
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    authority.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign, KeyUsagePurpose::DigitalSignature];
    let key = KeyPair::generate().map_err(failed)?;
    let certificate = authority.self_signed(&key).map_err(failed)?;
    let issuer = Issuer::new(authority, key);
    let mut files = vec![("authority.pem".to_string(), certificate.pem())];
    for role in [End::Application, End::Display, End::Guest] {
        let name = role.name();
        let is_server = role == End::Application;
        let purpose = if is_server { ExtendedKeyUsagePurpose::ServerAuth } else { ExtendedKeyUsagePurpose::ClientAuth };
        let mut end = params(name)?;
        end.use_authority_key_identifier_extension = true;
        end.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        end.extended_key_usages = vec![purpose];
        let key = KeyPair::generate().map_err(failed)?;
        files.push((format!("{name}.pem"), end.signed_by(&key, &issuer).map_err(failed)?.pem()));
        files.push((format!("{name}.key.pem"), key.serialize_pem()));
    }
    std::fs::create_dir_all(folder)
        .map_err(|error| ClusterError::Certificate { path: folder.into(), fault: error.to_string() })?;
    files.into_iter().map(|(name, text)| write(&folder.join(name), &text)).collect()
}

fn write(path: &Path, text: &str) -> Result<PathBuf, ClusterError> {
    use std::io::Write;
    let failed = |error: std::io::Error| ClusterError::Certificate { path: path.into(), fault: error.to_string() };
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path).and_then(|mut file| file.write_all(text.as_bytes())).map_err(failed)?;
    Ok(path.to_path_buf())
}
